"""Numbers of any magnitude: masses from subnormal to 1e300 kg, gravity, and speeds."""

from touchstone.scenarios.difficulty.checks import Case, Checks
from touchstone.scenarios.difficulty.family import family
from touchstone.scenarios.scenario import Arc, Truth
from touchstone.scenarios.solids import ball, block, slab

HALF = 0.05


def _box(mass: float, gravity: float, summary: str) -> Case:
    place = (0.0, 0.0, HALF)
    return Case(
        summary,
        (slab("floor", "wood"), block("box", "wood", (HALF,) * 3, mass, place)),
        Checks(rest_from=0.5),
        duration=0.8,
        truths=(Truth("box", "arcs", (Arc(0.0, place),)),),
        fields={"gravity": (0.0, 0.0, -gravity)},
    )


@family("mass", "kg", (1.0, 1e-6, 1e-12, 1e-30, 1e-100, 1e-300, 1e-310))
def tiny_mass(level: float) -> Case:
    """A cube of almost no mass rests on the floor."""
    return _box(level, 9.81, f"a cube of {level:g} kg rests")


@family("mass", "kg", (1.0, 1e6, 1e12, 1e30, 1e100, 1e300))
def huge_mass(level: float) -> Case:
    """A cube of enormous mass rests on the floor."""
    return _box(level, 9.81, f"a cube of {level:g} kg rests")


@family("gravity", "m/s^2", (9.81, 1e2, 1e3, 1e4, 1e5))
def strong_gravity(level: float) -> Case:
    """A cube rests on the floor under strong gravity."""
    return _box(1.0, level, f"a cube rests under {level:g} m/s^2")


@family("gravity", "m/s^2", (9.81, 1e-3, 1e-10, 1e-100, 1e-310))
def weak_gravity(level: float) -> Case:
    """A cube rests on the floor under almost no gravity."""
    return _box(1.0, level, f"a cube rests under {level:g} m/s^2")


@family("speed", "m/s", (1.0, 1e2, 1e4, 9e5))
def fast_flight(level: float) -> Case:
    """A ball flies past a floor at any speed."""
    start, velocity = (0.0, 0.0, 1.0), (level, 0.0, 0.0)
    return Case(
        f"a ball flies at {level:g} m/s",
        (ball("ball", "wood", HALF, 1.0, start, velocity),),
        Checks(position=max(5e-3, 1e-9 * level)),
        duration=0.4,
        truths=(Truth("ball", "arcs", (Arc(0.0, start, velocity),)),),
        fields={"effects": ("restitution", "friction")},
    )
