"""Balls on a table: some slide until they roll (5/7 v_0 after 2 v_0 / (7 mu g)), others roll from the
start."""

from dataclasses import replace
from math import cos, radians, sin

import numpy as np

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.families.slide import HEADINGS
from touchstone.scenarios.scenario import GRAVITY, Arc, PairCoefficients, Scenario, Truth, Vector, vector
from touchstone.scenarios.solids import ball, slab
from touchstone.scenarios.truths.published import Published

RADIUS = 0.05
LANE = 1.0
"""Distance between the starts of neighbouring balls [m]: they fan out and never touch."""

CORIOLIS = (
    "Coriolis (1835), Théorie mathématique des effets du jeu de billard: a ball without spin rolls at "
    "last at 5/7 of its speed"
)


@scene
def slip() -> Scenario:
    """Three balls that start without spin: friction turns them until they roll."""
    tags = ("probe", "headings", "literature")
    plain = rolling("slip", tags, HEADINGS, mu=0.3, speed=2.0, spin=0.0, duration=1.0)
    value = 5 / 7 * 2.0
    return replace(
        plain,
        published=tuple(
            Published(
                f"{a:g}° speed", f"ball_{a:g}", "velocity", value, 0.01 * value, CORIOLIS, 1.0, 1.0, along
            )
            for a in HEADINGS
            for along in [(cos(radians(a)), sin(radians(a)), 0.0)]
        ),
    )


@scene
def roll() -> Scenario:
    """Three balls that roll from the start and do not slow down."""
    return rolling(
        "roll", ("probe", "headings", "conservative"), HEADINGS, mu=0.3, speed=1.0, spin=1.0, duration=1.5
    )


@scene
def slip_seeded() -> tuple[Scenario, ...]:
    """Balls as in `slip` with random headings, speeds, spins and frictions."""
    return tuple(_seeded(seed) for seed in range(3))


def _seeded(seed: int) -> Scenario:
    rng = np.random.default_rng(seed)
    mu, speed, spin = rng.uniform(0.2, 0.8), rng.uniform(0.5, 3.0), rng.uniform(-0.5, 0.9)
    headings = np.sort(rng.uniform(0.0, 90.0, 3)).tolist()
    return rolling(f"slip_seed{seed}", ("seeded", "headings"), tuple(headings), mu, speed, spin, 1.5, seed)


def rolling(
    name: str,
    tags: tuple[str, ...],
    headings: tuple[float, ...],
    mu: float,
    speed: float,
    spin: float,
    duration: float,
    seed: int = 0,
) -> Scenario:
    """Balls at `headings` [degrees] with `speed` [m/s] and the share `spin` of the spin of rolling."""
    names = [f"ball_{heading:.3g}" for heading in headings]
    paths = [_arcs((0.0, LANE * k, RADIUS), radians(a), mu, speed, spin) for k, a in enumerate(headings)]
    balls = tuple(
        ball(name, "wood", RADIUS, 1.0, arcs[0].position, arcs[0].velocity, arcs[0].angular_velocity)
        for name, arcs in zip(names, paths)
    )
    does = "roll" if spin == 1 else "slide until they roll"
    return Scenario(
        name=name,
        summary=f"balls {does} at {speed:.3g} m/s with mu = {mu:.3g}",
        tags=tags,
        bodies=(slab("table", "wood"), *balls),
        coefficients=(PairCoefficients("wood", "wood", 0.0, mu),),
        duration=duration,
        truths=tuple(Truth(name, "arcs", arcs) for name, arcs in zip(names, paths)),
        seed=seed,
    )


def _arcs(start: Vector, turn: float, mu: float, speed: float, spin: float) -> tuple[Arc, ...]:
    along, axis = np.array([cos(turn), sin(turn), 0.0]), np.array([-sin(turn), cos(turn), 0.0])
    slip = speed * (1 - spin)
    # The slip decreases at mu g through the centre and at 5/2 mu g through the spin.
    time, end = 2 / 7 * slip / (mu * GRAVITY), speed - 2 / 7 * slip
    rolled = Arc(
        time,
        vector(start + (speed + end) / 2 * time * along),
        vector(end * along),
        angular_velocity=vector(end / RADIUS * axis),
    )
    if slip == 0:
        return (rolled,)
    slid = Arc(
        0.0,
        start,
        vector(speed * along),
        vector(-mu * GRAVITY * along),
        vector(spin * speed / RADIUS * axis),
        vector(5 / 2 * mu * GRAVITY / RADIUS * axis),
    )
    return slid, rolled
