"""Tolerances and budgets that several modules of the contact solver use."""

RESIDUAL_TARGET, RESIDUAL_DENSE, RESIDUAL_ACCEPTED = 4e-13, 9e-10, 1e-9
"""Residual at which a contact solve ends, at which it ends in a dense substep, and at which it counts as
converged [m/s]: bodies sink by that times a frame. The way from the second to the first takes up to half of
the factorisations."""
ROUNDING = 2.0**-52
"""Relative spacing of doubles [1]: an impulse p hides velocities below that times p / m of its row."""
EVEN_ROUNDINGS = 64
"""Deviation from the most even load, in roundings of the whole load, that stays: what rests is not moved
[1]."""
RESIDUAL_OPEN = 1e-7
"""Residual from which a contact solve counts as open [m/s]: bodies sink by 2e-9 m a frame."""
NEWTON_INNER, NEWTON_FACTORS = 15, 150
"""Factorisations of one outer iteration, and of all outer iterations of an island."""
INTERIOR_BOUNDARY, INTERIOR_CENTRE, INTERIOR_FRICTION = 0.995, 1e-6, 1e-9
"""Share of the way to the boundary of a cone, least share of the products that a step aims at, and least
coefficient of friction [1]."""
