"""Tolerances, limits and budgets of the contact solver."""

RESIDUAL_TARGET, RESIDUAL_DENSE, RESIDUAL_ACCEPTED = 4e-13, 9e-10, 1e-9
"""Residual at which a contact solve ends, at which it ends in a dense substep, and at which it counts as
converged [m/s]: bodies sink by that times a frame. The way from the second to the first takes up to half of
the factorisations."""
ROUNDING = 2.0**-52
"""Relative spacing of doubles [1]: an impulse p hides velocities below that times p / m of its row."""
STEADY_SHARE, STEADY_ROUNDINGS = 0.02, 32
"""Share of RESIDUAL_TARGET at which a solve ends in the frame after a warm start that missed it, but at least
so many roundings of the impulses [1]: the impulses then remain a solution while nothing moves."""
RESIDUAL_OPEN = 1e-7
"""Residual from which a contact solve counts as open [m/s]: bodies sink by 2e-9 m a frame."""
RESIDUAL_ROUNDING = 1e-14
"""Change of velocity at which an inner minimisation ends, however small the residual is [m/s]."""
FIRST_SWEEPS = 8
"""Sweeps before Newton's method: they determine which contacts slide and which are open."""
MOST_SWEEPS, MOST_VISITS = 200, 20_000
"""Sweeps if Newton's method is not used or failed, or row visits if those allow more sweeps: about 2 ms."""
DENSE_SWEEPS, DENSE_VISITS = 32, 4_000
"""The same in a dense substep: a frame has tens of them, and each starts from the forces of the last."""
SLIDE_STEPS = 40
"""Iterations for the friction of one sliding row; up to 5 are usual."""
SLIDE_ROUNDING, SLIDE_CLOSE = 1e-15, 1e-7
"""Relative deviation from the cone at which that friction has converged, some roundings, and deviation after
which one step of Newton's method makes it so [1]."""
SPEED_LEAST, SLIDE_MOST = 1e-100, 1e100
"""Slowest approach that gets an impulse [m/s], and largest ratio of the sliding velocity to friction for
which friction is computed [1/kg]: their squares neither underflow nor overflow."""
COMPLIANCE_FIRST, COMPLIANCE_LAST, COMPLIANCE_LEAST = 0.03, 1e-5, 1e-10
"""Compliance of the proximal problem over the row's own mobility [1]: first, with a unique solution, or the
square root of the residual [m/s] if that is less; last; and least, for towers and jammed bodies."""
COMPLIANCE_ROUNDING = 1e-17
"""Compliance times the residual [m/s] below which rounding exceeds the remaining residual."""
COMPLIANCE_FALL, COMPLIANCE_RISE = 0.3, 5.0
"""Factors of the compliance after a slow decrease of the residual, and after a failed Newton iteration
[1]."""
RESIDUAL_FALL = 0.1
"""Fraction of the residual that an outer iteration may leave before the compliance falls [1]."""
INNER_SHARE = 1e-2
"""Change of velocity over the residual, times the compliance, at which an outer iteration ends [1]."""
NEWTON_INNER, NEWTON_FACTORS = 15, 150
"""Factorisations of one outer iteration, and of all outer iterations of an island."""
NEWTON_WORK, NEWTON_ALLOWANCE, NEWTON_MOST = 3e7, 1e7, 3e9
"""Multiplications of all factorisations of a frame, some 15 ms; those of an island after these are used up;
and those over the frame's up to which islands have these, about 2 s."""
NEWTON_STALLS = 4
"""Outer iterations with little progress after which a converged solution is accepted."""
LINE_SHARE, LINE_HALVES = 0.1, 10
"""Least decrease of g.M^-1 g over that of a full Newton step [1], and most halvings of the step."""
EXTRAPOLATION_LEAST, EXTRAPOLATION_MOST, EXTRAPOLATION_RISE = 3.0, 1e6, 1.1
"""Shortest and longest extrapolation of impulses over their last change, and largest accepted ratio of the
residual after it to that before [1]. Shorter ones go on for tens of iterations, and rounding ends them."""
INTERIOR_FROM, INTERIOR_ROWS = 1e-5, 16
"""Residual after the first sweeps above which the interior-point method precedes Newton's method [m/s], and
rows from which it does: Newton's method alone solves most smaller islands in as few factorisations, and keeps
the solution of the substep before where Coulomb's law has several."""
INTERIOR_STEPS, INTERIOR_ALLOWANCE = 120, 5e7
"""Most steps of the interior-point method (10 to 30 usual, 60 in jams), and multiplications of an island's
steps for which it runs after the frame's are used up (30 bodies in a heap)."""
INTERIOR_FEW, INTERIOR_MOST = 40, 4e9
"""Most steps of the interior-point method after NEWTON_MOST, and multiplications over the frame's up to which
it runs, 2 to 3 s; after these, sweeps alone."""
INTERIOR_TARGET, INTERIOR_LEAST, INTERIOR_STALLS = 1e-8, 1e-6, 4
"""Residual at which it ends and leaves the rest to Newton's method, except in dense substeps; residual below
which it ends where rounding stops it, and steps that tell so [m/s]."""
INTERIOR_START = 3.0
"""Velocity error that a start near the present impulses allows for, over their residual [1]; its square times
the mean mass is the product v.q of every row."""
INTERIOR_SHORT, INTERIOR_LONG = 0.1, 0.8
"""Shares of a full step below which it takes less of the derivative of friction, and above which more [1]."""
INTERIOR_BOUNDARY, INTERIOR_CENTRE, INTERIOR_FRICTION = 0.995, 1e-6, 1e-9
"""Share of the way to the boundary of a cone, least share of the products that a step aims at, and least
coefficient of friction [1]."""
