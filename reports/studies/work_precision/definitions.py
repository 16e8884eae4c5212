"""Scenes, steps, settings and quantities of the study `work-precision`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from touchstone.adapters.contract import DRIVES
from touchstone.adapters.knobs import Choice
from touchstone.adapters.registry import ENGINES, installed, settings_of
from touchstone.reports.runner.cells import CATALOGUE, PERTURBED, Cell, grid
from touchstone.reports.runner.measures import PERTURBED_SEEDS
from touchstone.reports.runner.tasks import own_profile
from touchstone.scenarios.catalogue import tagged

STUDY = "work-precision"
REFERENCE = "reference"
PROBES = ("fall", "bounce_e05", "collide_oblique", "slide", "slip", "stack")
"""Probes of the default study: flight, impact, oblique impact, sliding, rolling, resting."""
MECHANISMS = ("double_pendulum", "slider_crank")
"""Mechanisms of the default study: a tree and a loop."""
QUICK = ("ball_snip", "fall", "bounce_e05", "slide", "stack")
STEPS = tuple(1 / (60 * 2**k) for k in range(6))
"""Native steps of every engine [s]."""
QUICK_LADDER = ("ball_snip", "bounce_e05")
"""Scenes of the ladder in the quick study."""
QUICK_STEPS = (1 / 60, 1 / 240, 1 / 960)
REPEATS, QUICK_REPEATS = 3, 2
"""Rounds of timing, each with new processes."""
PROFILES: dict[str, tuple[str, ...]] = {
    REFERENCE: ("paper", "balanced", "accurate"),
    "mujoco": ("recommended", "default", "accurate"),
    "bullet": ("recommended", "maximal", "accurate"),
    "dart": ("recommended", "accurate"),
}
"""Profiles that are played at all steps; of an engine that is not named, its first."""
KNOBS: dict[str, tuple[str, ...]] = {
    "mujoco": ("solref=0.04", "solref=0.005", "impratio=10", "noslip_iterations=10", "integrator=RK4"),
    "bullet": (
        "numSolverIterations=10",
        "numSolverIterations=250",
        "constraintSolverType=dantzig",
        "contactERP=0.02",
        "contactProcessingThreshold=0",
    ),
    "dart": ("solver=pgs", "solver=nsgs", "detector=dart", "detector=ode", "split_impulse=on"),
}
"""Settings that are changed one at a time in an engine's first profile, and played at all steps too."""
FINE, FINER = 1 / 1920, 1 / 3840
"""Steps of the converged solutions and of their check [s]."""
TRUTH_PROFILE = "accurate"
"""The profile of the converged solutions; of an engine that has none, its first."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A quantity whose error is measured.

    Attributes:
        unit: SI.
        tolerance: error that most users accept.
        floor: error below which two settings count as equal: what rounding or the judge leaves open.
        meaning: definition of the error.
    """

    name: str
    unit: str
    tolerance: float
    floor: float
    meaning: str


QUANTITIES = {
    one.name: one
    for one in (
        Quantity(
            "position",
            "m",
            1e-3,
            1e-9,
            "largest distance of a centre of mass from the truth, up to the horizon",
        ),
        Quantity("overlap", "m", 1e-3, 1e-8, "deepest overlap of two bodies in a displayed frame"),
        Quantity(
            "energy",
            "1",
            1e-2,
            1e-9,
            "energy gained or lost without a cause, over the largest kinetic energy of the true motion",
        ),
        Quantity(
            "friction",
            "1",
            2e-2,
            1e-6,
            "largest relative error of stopping distance, rolling time, sliding force or friction cone",
        ),
        Quantity("events", "s", 1 / 120, 1e-6, "largest error of the time of an expected event"),
    )
}


def scenes(quick: bool = False) -> tuple[str, ...]:
    """Default scenes: the gallery, six probes and two mechanisms."""
    if quick:
        return QUICK
    return (*(scenario.name for scenario in tagged("gallery")), *PROBES, *MECHANISMS)


def profiles_of(engine: str) -> tuple[str, ...]:
    """Profiles of an engine that are played at all steps."""
    return PROFILES.get(engine, (own_profile(engine),))


def measured_cells(names: Sequence[str], engines: Sequence[str], quick: bool = False) -> list[Cell]:
    """Cells whose errors are measured: profiles and single settings at all steps, and at the own one."""
    steps = QUICK_STEPS if quick else STEPS
    cells: list[Cell] = []
    for scene in names:
        for engine in engines:
            first = profiles_of(engine)[0]
            cells += grid([scene], [(engine, p) for p in profiles_of(engine)], steps=steps)
            if engine != REFERENCE:
                cells += grid([scene], [(engine, first)])
                for knob in KNOBS.get(engine, ()):
                    cells += grid([scene], [(engine, first)], steps=steps, changes=[f"{engine}.{knob}"])
    return list(dict.fromkeys(cells))


def truth_cells(
    scene: str, sources: tuple[str, str] = (CATALOGUE, PERTURBED), drive: str = DRIVES[0]
) -> list[Cell]:
    """Converged solutions of a scene by every installed engine, each with its check at half the step, then a
    plain run of the reference and perturbed ones, for the horizon.

    Args:
        sources: of the scene, and of the scene moved by a little.
        drive: of the engines' driven bodies.
    """
    plain, moved = sources
    codes = [
        Cell(
            *(scene, engine, TRUTH_PROFILE if TRUTH_PROFILE in entry.profiles else own_profile(engine), dt),
            source=plain,
            options=() if drive == DRIVES[0] or engine == REFERENCE else (f"drive={drive}",),
        )
        for engine, entry in ENGINES.items()
        if installed(engine)
        for dt in (FINE, FINER)
    ]
    column = (scene, REFERENCE, TRUTH_PROFILE, 1 / 240)
    return [
        *codes,
        Cell(*column, source=plain),
        *(Cell(*column, seed=seed, source=moved) for seed in PERTURBED_SEEDS),
    ]


BASE, WHOLE = "balanced", ("paper", "accurate")
"""Profile in which one setting changes at a time, and profiles that are compared with it as a whole."""
NOWHERE = "-"
"""Stands for the profile of a value that no profile has."""


def changes() -> dict[str, str]:
    """Change of one setting of `balanced` -> the profile that has its value: of a choice every other value,
    of a number that of `accurate`."""
    table = settings_of(REFERENCE)
    found: dict[str, str] = {}
    for setting in table.values():
        base, other = (setting.profiles[table.column(profile)] for profile in (BASE, "accurate"))
        values = list(setting.values) if isinstance(setting, Choice) else [other]
        for value in values:
            if value != base:
                found[f"{setting.name}={value}"] = "accurate" if value == other else NOWHERE
    return found


def ladder_cells(names: Sequence[str]) -> list[Cell]:
    """Cells of the other profiles, and of `balanced` with one change each."""
    whole = grid(names, [(REFERENCE, profile) for profile in WHOLE])
    single = [
        cell
        for change in changes()
        for cell in grid(names, [(REFERENCE, BASE)], changes=[f"{REFERENCE}.{change}"])
    ]
    return [*whole, *single]
