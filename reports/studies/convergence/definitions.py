"""Scenes, steps, cells and metrics of the study `convergence`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from touchstone.adapters.registry import ACCURATE, ENGINES
from touchstone.reports.run.request import REFERENCE
from touchstone.reports.studies.agreement.study import NoTruth, own_profile
from touchstone.reports.studies.convergence.measure import FRAME_RATE
from touchstone.reports.sweep.cells import Cell
from touchstone.scenarios.catalogue import catalogue, tagged

STUDY = "convergence"
STEPS = tuple(1 / (FRAME_RATE * 2**k) for k in range(7))
"""Native steps of every engine [s]."""
BALANCED = "balanced"
ORDER, FLOOR, NEARER = "convergence.order", "convergence.floor", "convergence.nearer"
NEAR = 1.02
"""Ratio of errors up to which two engines are equally near to the truth [1]."""
MEASURE = "touchstone.reports.studies.convergence.measure:convergence_error"
SOURCE = "touchstone.reports.studies.convergence.measure:at_frame_rate"
SMOOTH = ("fall", "tumble_unstable", "spring", "incline_slides", "turntable", "shaker_along", "belt")
EVENTS = ("bounce_e05", "collide_sticks", "slip", "slide", "platform_slip", "shaker_across")
"""Default scenes beside the curved ones: one or two of each family, without and with events."""


def scenes() -> tuple[str, ...]:
    """Default scenes; of seeded variants none."""
    curved = (scenario.name for scenario in tagged("curved") if "_seed" not in scenario.name)
    return (*curved, *SMOOTH, *EVENTS)


def columns_of(engines: Iterable[str]) -> list[tuple[str, str]]:
    """(engine, profile) of the study: the reference in two profiles, the others in their first."""
    return [
        (engine, profile)
        for engine in engines
        for profile in ((BALANCED, ACCURATE) if engine == REFERENCE else (own_profile(engine),))
    ]


def cells(names: Sequence[str], engines: Sequence[str]) -> list[Cell]:
    """All cells, scene by scene.

    Raises:
        NoTruth: a scene has no truth.
    """
    if lacking := [name for name in names if not catalogue()[name].truths]:
        valid = ", ".join(s.name for s in catalogue().values() if s.truths)
        raise NoTruth(f"no truth for {', '.join(lacking)}; valid: {valid}")
    return [
        Cell(name, *column, dt, effects=True, measure=MEASURE, source=SOURCE)
        for name in names
        for column in columns_of(engines)
        # all effects: at coarse steps bodies leave a plan's bounds
        for dt in dict.fromkeys((*STEPS, own_step(*column)))
    ]


def own_step(engine: str, profile: str) -> float:
    """An engine's own step in a profile [s]."""
    return ENGINES[engine].profiles[profile]
