"""Points of the study: per cell and quantity the error, its parts and the time per simulated second.

Errors are those against the closed form or the band of converged solutions, up to the horizon.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from math import inf, nan

import numpy as np
import pandas as pd

from touchstone.adapters.contract import DRIVES, Array
from touchstone.adapters.knobs import Choice
from touchstone.adapters.registry import ENGINES, installed, settings_of
from touchstone.reports.runner.cells import CATALOGUE, PERTURBED, TIMING, Cell, grid, scene_of
from touchstone.reports.runner.content_hash import hash_of
from touchstone.reports.runner.measures import (
    FRAMES,
    HORIZON_DISTANCE,
    PATH,
    PERTURBED_SEEDS,
    closed_path,
    last_within,
    moving,
)
from touchstone.reports.runner.request import line_of
from touchstone.reports.runner.tasks import own_profile
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.scenario import Scenario

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
QUICK_STEPS = (1 / 60, 1 / 240, 1 / 960)
REPEATS, QUICK_REPEATS = 3, 2
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
            *("position", "m", 1e-3, 1e-9),
            "largest distance of a centre of mass from the truth, up to the horizon",
        ),
        Quantity("overlap", "m", 1e-3, 1e-8, "deepest overlap of two bodies in a displayed frame"),
        Quantity(
            *("energy", "1", 1e-2, 1e-9),
            "energy gained or lost without a cause, over the largest kinetic energy of the true motion",
        ),
        Quantity(
            *("friction", "1", 2e-2, 1e-6),
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
        drive: of the driven bodies in the solutions; the horizon is that of the scene as it plays by default,
            because kinematic links bounce off what they meet, which amplifies at once.
    """
    plain, moved = sources
    options = () if drive == DRIVES[0] else (f"drive={drive}",)
    codes = [
        Cell(
            *(scene, engine, TRUTH_PROFILE if TRUTH_PROFILE in entry.profiles else own_profile(engine), dt),
            source=plain,
            options=options,
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
    single = (grid(names, [(REFERENCE, BASE)], changes=[f"{REFERENCE}.{change}"]) for change in changes())
    return [*whole, *(cell for some in single for cell in some)]


SPREAD = 0.05
"""Share of the way of the bodies within which codes agree, and by which half the step may change one [1]:
what a first-order engine at a fitting step may be off (`verdict/limits.toml`)."""


@dataclass(frozen=True, slots=True)
class Band:
    """Positions per frame and body between those of the codes that agree, per coordinate.

    Attributes:
        codes: those that agree; fewer than two: there is no band, and `low` and `high` are empty.
        low, high: least and largest coordinates (f, n, 3) [m].
        width: largest distance of two of them [m].
        within: distance up to which codes agree and converge [m].
        change: what half the step changes of each code [m].
        outliers: distance from the band [m] of the other converged codes; without a band, from the nearest.
    """

    codes: tuple[str, ...]
    low: Array
    high: Array
    width: float = 0.0
    within: float = 0.0
    outliers: Mapping[str, float] = field(default_factory=dict)
    change: Mapping[str, float] = field(default_factory=dict)

    @property
    def words(self) -> str:
        """One line: who agrees, to what, who is off, who has not converged."""
        off = [f"{name} is {1e3 * far:.3g} mm off" for name, far in self.outliers.items()]
        left = {name: far for name, far in self.change.items() if name not in (*self.codes, *self.outliers)}
        said = [f"{name} changes by {1e3 * far:.3g} mm with half the step" for name, far in left.items()]
        if self.codes:
            head = f"{', '.join(self.codes)} agree to {1e3 * self.width:.3g} mm"
        elif len(self.outliers) > 1:
            head = f"codes converge to different models, more than {1e3 * self.within:.3g} mm apart"
            off = [f"{name} is {1e3 * far:.3g} mm from the nearest" for name, far in self.outliers.items()]
        else:
            head = f"fewer than two codes converge to {1e3 * self.within:.3g} mm"
            off = []
        return "; ".join([head, *off, *said])


def distance(one: Array, other: Array, horizon: int) -> float:
    """Largest distance of two paths over bodies and frames up to the horizon [m]."""
    return outside(one, other, other, horizon)


def outside(path: Array, low: Array, high: Array, horizon: int) -> float:
    """Largest distance of a path from a band over bodies and frames up to the horizon [m]."""
    last = min(len(path), len(low), horizon + 1)
    beyond = path[:last] - np.clip(path[:last], low[:last], high[:last])
    return float(np.linalg.norm(beyond, axis=-1).max())


def band_of(
    codes: Mapping[str, tuple[Array, Array]], horizon: int, least: float, closed: Array | None = None
) -> Band:
    """The band of the largest group of converged codes that agree pairwise, of equally large ones the
    narrowest. There is none where as many others agree on something else.

    Args:
        codes: paths (f, n, 3) [m] of an engine at twice its finest step, and at that step.
        horizon: frame up to which paths are compared.
        least: distance within which codes agree in any case [m].
        closed: the closed form (f, n, 3) [m], which is the band: codes agree if they are near it.
    """
    ways = [distance(finer, np.broadcast_to(finer[:1], finer.shape), horizon) for _, finer in codes.values()]
    way = float(np.median(ways))
    within = max(least, SPREAD * way)
    change = {name: distance(*both, horizon) for name, both in codes.items()}
    paths = {name: finer for name, (_, finer) in codes.items() if change[name] <= within}
    apart = {
        frozenset((one, other)): distance(paths[one], paths[other], horizon)
        for one, other in combinations(paths, 2)
    }
    if closed is not None:
        group = tuple(name for name in paths if distance(paths[name], closed, horizon) <= within)
        low = high = closed
    else:
        group = _agreeing(tuple(paths), apart, within)
        if not group:
            far = {name: min((apart[p] for p in apart if name in p), default=np.inf) for name in paths}
            nothing = np.zeros((0, 0, 3))
            return Band((), nothing, nothing, 0.0, within, far, change)
        low, high = (bound([paths[name] for name in group], axis=0) for bound in (np.min, np.max))
    outliers = {name: outside(paths[name], low, high, horizon) for name in paths if name not in group}
    return Band(group, low, high, _width(group, apart), within, outliers, change)


def _width(group: Sequence[str], apart: Mapping[frozenset[str], float]) -> float:
    return max((apart[frozenset(pair)] for pair in combinations(group, 2)), default=0.0)


def _agreeing(names: Sequence[str], apart: Mapping[frozenset[str], float], within: float) -> tuple[str, ...]:
    """The largest group of two or more within a distance; empty if there is none, or a rival one."""
    for size in range(len(names), 1, -1):
        found = [group for group in combinations(names, size) if _width(group, apart) <= within]
        if found:
            best = min(found, key=lambda group: _width(group, apart))
            return () if any(not set(best) & set(group) for group in found) else best
    return ()


FRICTION = ("friction.stop", "friction.coast", "friction.heading", "friction.cone", "rolling.time")
"""Relative errors whose largest is the error of friction."""
EVENTS = ("events.touch", "events.roll", "events.leave", "events.land", "events.meet", "events.part")
LEAST_DROP = 0.01
"""Height whose potential energy is the least scale of energy [m]: where nothing moves."""
CLOSED_FORM, BAND = "closed form", "band"


@dataclass(frozen=True, slots=True)
class CellRun:
    """What a cell left: its rows, centres of mass (f, n, 3) [m] of the moving bodies, seconds per frame."""

    rows: pd.DataFrame
    path: Array
    frames: Array

    def values(self, *metrics: str) -> dict[tuple[str, str], float]:
        """(metric, subject) -> value, without what was not measured."""
        part = self.rows[self.rows.metric.isin(metrics)]
        found = zip(part.metric, part.subject, part.value, part.verdict)
        return {(m, s): v for m, s, v, verdict in found if np.isfinite(v) or verdict == "fail"}


@dataclass(frozen=True, slots=True)
class TrueMotion:
    """The true motion of a scene, which is known to a band where it has no closed form.

    Attributes:
        low, high: least and largest coordinates of the moving bodies (f, n, 3) [m], the same in closed form;
            None where codes do not agree.
        source: per quantity CLOSED_FORM or BAND.
        width: per quantity width of the band.
        horizon: frame up to which positions and events are compared.
        energy: scale of energies [J].
        events: (metric, subject) -> earliest and latest time [s].
        band: what the codes agree on, with the outliers; None without codes.
    """

    low: Array | None
    high: Array | None
    horizon: int
    energy: float
    source: Mapping[str, str] = field(default_factory=dict)
    width: Mapping[str, float] = field(default_factory=dict)
    events: Mapping[tuple[str, str], tuple[float, float]] = field(default_factory=dict)
    band: Band | None = None


def run_of(rows: pd.DataFrame, scenario: Scenario) -> CellRun | None:
    """Rows of one cell, with its series; None if it did not end."""
    if rows.empty or (rows.outcome != "done").any():
        return None
    series = {m: np.asarray(s, dtype=float) for m, s in zip(rows.metric, rows.series) if s is not None}
    return CellRun(rows, series[PATH].reshape(-1, len(moving(scenario)), 3), series[FRAMES])


def truth_of(
    scenario: Scenario,
    codes: Mapping[str, tuple[CellRun, CellRun]],
    plain: CellRun | None,
    perturbed: Iterable[CellRun],
) -> TrueMotion | None:
    """The true motion: positions from the closed form if there is one, else the band of the codes, which
    also times the events.

    Args:
        codes: engine -> its converged solution and the check at half the step, which is the better of both.
        plain, perturbed: runs at one step, of the scene as it is and moved by a little.
    """
    closed = closed_path(scenario)
    if closed is None and not codes:
        return None
    horizon = _horizon(plain, perturbed, scenario.frame_count)
    band = None
    if codes:
        paths = {name: (fine.path, finer.path) for name, (fine, finer) in codes.items()}
        band = band_of(paths, horizon, QUANTITIES["position"].tolerance, closed)
    low, high = (band.low, band.high) if band and band.codes else (closed, closed)
    path = low if low is not None else next(iter(codes.values()))[1].path
    source = dict.fromkeys(("overlap", "energy", "friction"), CLOSED_FORM)
    source |= {"position": BAND if closed is None else CLOSED_FORM, "events": BAND}
    width = {"position": band.width} if band and band.codes and closed is None else {}
    events = _events([codes[name][1] for name in band.codes] if band else [], horizon / scenario.frame_rate)
    if events:
        width["events"] = max(last - first for first, last in events.values())
    return TrueMotion(low, high, horizon, _energy_scale(scenario, path), source, width, events, band)


def _events(runs: Sequence[CellRun], until: float) -> dict[tuple[str, str], tuple[float, float]]:
    """Earliest and latest time [s] of the events that all runs have until a time."""
    times = [run.values(*EVENTS) for run in runs]
    found = {}
    for key in times[0] if times else ():
        each = [one.get(key, inf) for one in times]
        if max(each) <= until:
            found[key] = min(each), max(each)
    return found


def _horizon(plain: CellRun | None, perturbed: Iterable[CellRun], last: int) -> int:
    """Last frame before a perturbed run is farther than HORIZON_DISTANCE from the unperturbed one."""
    apart = [np.linalg.norm(plain.path - other.path, axis=-1).max(axis=1) for other in perturbed if plain]
    return max(1, min([last, *(last_within(one, HORIZON_DISTANCE) for one in apart)]))


def _energy_scale(scenario: Scenario, path: Array) -> float:
    """Largest kinetic energy of translation in the true motion, at least that of a fall of LEAST_DROP [J]."""
    mass = np.array([scenario.bodies[k].mass for k in moving(scenario)])
    speed = np.diff(path, axis=0) * scenario.frame_rate
    kinetic = ((speed**2).sum(axis=-1) @ mass).max(initial=0.0) / 2
    return float(max(kinetic, mass.sum() * 9.81 * LEAST_DROP))


def errors_of(run: CellRun, truth: TrueMotion) -> dict[str, float]:
    """Error of a run per quantity; a quantity that does not apply is missing.

    A body that passed through another has an infinite error of overlap, an event that did not happen one of
    events. Positions and events have none where codes do not agree.
    """
    found = {}
    if truth.low is not None and truth.high is not None:
        found["position"] = outside(run.path, truth.low, truth.high, truth.horizon)
    tunnelled = run.values("overlap.tunnelled")
    overlap = run.values("overlap.max")
    if overlap:
        found["overlap"] = inf if any(tunnelled.values()) else max(0.0, *overlap.values())
    energy = _energy(run, truth.energy)
    if energy is not None:
        found["energy"] = energy
    friction = [abs(value) for value in run.values(*FRICTION).values() if np.isfinite(value)]
    if friction:
        found["friction"] = max(friction)
    if truth.events:
        times = run.values(*EVENTS)
        each = ((times.get(key, inf), *ends) for key, ends in truth.events.items())
        found["events"] = max(
            max(0.0, first - time, time - last) if time == time else inf for time, first, last in each
        )
    return found


def _energy(run: CellRun, scale: float) -> float | None:
    """Energy gained or lost without a cause, over the scale.

    Of the whole scene where nothing does work, else of the simulated bodies, else of all.
    """
    whole = run.values("energy.gain", "energy.loss")
    if whole:
        return max(abs(value) for value in whole.values())
    injected = {subject: value for (_, subject), value in run.values("energy.injected").items()}
    value = injected.get("simulated", injected.get("all"))
    return None if value is None else value / scale


def pareto(time: Array, error: Array, floor: float = 0.0) -> Array:
    """Whether each point is on the front: no other is better in one and no worse in the other (n,).

    Args:
        time: [s] (n,).
        error: (n,); errors below `floor` count as equal.
    """
    time, error = np.asarray(time, dtype=float), np.maximum(np.asarray(error, dtype=float), floor)
    order = np.lexsort((error, time))
    found = np.zeros(len(time), dtype=bool)
    least = np.inf
    for k, i in enumerate(order):
        if not np.isfinite(time[i]) or not np.isfinite(error[i]):
            continue
        # points of equal time and error are all on the front
        last = order[k - 1]
        twin = k > 0 and found[last] and (time[i], error[i]) == (time[last], error[last])
        if error[i] < least or twin:
            found[i], least = True, error[i]
    return found


def band(samples: Sequence[float]) -> tuple[float, float, float]:
    """Median, least and largest of the repeats; NaN without any."""
    values = np.asarray(samples, dtype=float)
    if not len(values):
        return np.nan, np.nan, np.nan
    return float(np.median(values)), float(values.min()), float(values.max())


def deficit(ours: Array, theirs: Array, floor: float) -> Array:
    """By which factor each of their points is better than the nearest of ours (m,); at most 1: dominated.

    Our point answers theirs up to the larger of both ratios, of time and of error: at most so many times
    slower and so many times less accurate. Of our points the best one counts.

    Args:
        ours: time and error (n, 2).
        theirs: time and error (m, 2).
        floor: errors below it count as equal.
    """
    a, b = (np.array(points, dtype=float).reshape(-1, 2) for points in (ours, theirs))
    a[:, 1], b[:, 1] = np.maximum(a[:, 1], floor), np.maximum(b[:, 1], floor)
    if not len(a):
        return np.full(len(b), np.inf)
    with np.errstate(invalid="ignore"):
        factors = np.maximum(a[None, :, 0] / b[:, None, 0], a[None, :, 1] / b[:, None, 1])
    return np.asarray(np.where(np.isnan(factors), np.inf, factors).min(axis=1))


COLUMNS = (
    *("study", "scenario", "engine", "profile", "settings", "dt", "quantity", "unit"),
    *("error", "discretisation", "model", "time", "time_low", "time_high", "front", "own_front"),
    *("truth", "truth_width", "horizon", "outcome", "verdict", "reason", "reproduce"),
)
"""Columns of the table. Times are in s per simulated second: the median of the rounds, and their range;
`discretisation` is the change from the engine's own finest step, `model` the error there; `front` is that of
all engines, `own_front` that of the engine alone."""


class SweptRuns:
    """Rows of a sweep (with series) by cell, with the runs and truths made of them."""

    def __init__(self, frame: pd.DataFrame) -> None:
        self._rows = dict(iter(frame.groupby("cell", sort=False)))

    def rows(self, cell: Cell) -> pd.DataFrame:
        """Rows of a cell."""
        found: pd.DataFrame = self._rows.get(hash_of(cell), _EMPTY)
        return found

    def run(self, cell: Cell) -> CellRun | None:
        """The run of a cell; None if it did not end."""
        return run_of(self.rows(cell), scene_of(cell.source, cell.scenario, 0))

    def truth(self, scenario: Scenario, cells: Sequence[Cell]) -> TrueMotion | None:
        """The true motion of a scene from its `truth_cells`, or without them."""
        found: dict[str, dict[float, CellRun]] = {}
        last: list[CellRun | None] = []
        for cell in cells:
            run = self.run(cell)
            if cell.dt > FINE:
                last.append(run)
            elif run is not None:
                found.setdefault(cell.engine, {})[cell.dt] = run
        codes = {name: (both[FINE], both[FINER]) for name, both in found.items() if len(both) == 2}
        plain, *moved = last or [None]
        return truth_of(scenario, codes, plain, [run for run in moved if run])

    def frames(self, cell: Cell, repeat: int) -> Array:
        """Seconds of the displayed frames of a cell that were timed in a round; empty if it was not."""
        timed = self.rows(timing_cell(cell, repeat))
        found = [series for metric, series in zip(timed.metric, timed.series) if metric == FRAMES]
        return np.asarray(found[0] if found else [], dtype=float)

    def times(self, cell: Cell, run: CellRun, rounds: int) -> list[float]:
        """Seconds per simulated second of each round: the frames timed, extrapolated to the whole scene by
        the seconds of all frames in the accuracy run."""
        duration = scene_of(cell.source, cell.scenario, 0).duration
        several = (self.frames(cell, repeat) for repeat in range(rounds))
        return [
            float(frames.sum() * run.frames.sum() / run.frames[: len(frames)].sum() / duration)
            for frames in several
            if len(frames)
        ]


_EMPTY = pd.DataFrame({"outcome": [], "metric": [], "series": []})


def timing_cell(cell: Cell, repeat: int) -> Cell:
    """The timing cell of an accuracy cell."""
    return replace(cell, measure=TIMING, repeat=repeat)


def points(frame: pd.DataFrame, cells: Sequence[Cell], rounds: int) -> pd.DataFrame:
    """The table of the study from the rows of its sweep (with series); `attrs["bands"]` has the lines on the
    bands by scene."""
    swept = SweptRuns(frame)
    found: list[dict[str, object]] = []
    bands: dict[str, str] = {}
    for scene in dict.fromkeys(cell.scenario for cell in cells):
        mine = [cell for cell in cells if cell.scenario == scene]
        truth = swept.truth(catalogue()[scene], truth_cells(scene))
        if truth is not None and truth.band is not None and closed_path(catalogue()[scene]) is None:
            bands[scene] = truth.band.words
        runs = {cell: swept.run(cell) for cell in mine}
        finest: dict[tuple[str, str, tuple[str, ...]], Cell] = {}
        for cell in sorted(mine, key=lambda one: one.dt):
            finest.setdefault(_family(cell), cell)
        limits = {key: runs[cell] for key, cell in finest.items()}
        for cell in mine:
            base = _base(cell, swept.rows(cell))
            run = runs[cell]
            if run is None or truth is None:
                found.append({**base, "quantity": "", "error": nan})
                continue
            limit = limits[_family(cell)] if finest[_family(cell)] != cell else None
            times = dict(zip(("time", "time_low", "time_high"), band(swept.times(cell, run, rounds))))
            horizon = truth.horizon / scene_of(cell.source, scene, 0).frame_rate
            for parts in _parts(run, limit, truth):
                found.append({**base, **times, **parts, "horizon": horizon})
    table = pd.DataFrame(found, columns=list(COLUMNS))
    table.attrs["bands"] = bands
    measured = table[table.quantity != ""]
    place = ["scenario", "quantity"]
    for name, keys in (("front", place), ("own_front", [*place, "engine"])):
        table[name] = False
        for (_, quantity, *_), part in measured.groupby(keys):
            floor = QUANTITIES[str(quantity)].floor
            table.loc[part.index, name] = pareto(part.time.to_numpy(), part.error.to_numpy(), floor)
    return table


def _family(cell: Cell) -> tuple[str, str, tuple[str, ...]]:
    """Cells that differ in their step only."""
    return cell.engine, cell.profile, cell.changes


def _parts(run: CellRun, limit: CellRun | None, truth: TrueMotion) -> Iterator[dict[str, object]]:
    """Per quantity: the error, what the step adds to it, and what is left at the engine's finest step."""
    errors = errors_of(run, truth)
    finest = errors_of(limit, truth) if limit else errors
    for name, error in errors.items():
        left = finest.get(name, nan)
        apart = abs(error - left)
        if name == "position" and limit:
            apart = distance(run.path, limit.path, truth.horizon)
        yield {
            "quantity": name,
            "unit": QUANTITIES[name].unit,
            "error": error,
            "discretisation": apart if limit else nan,
            "model": left,
            "truth": truth.source.get(name, ""),
            "truth_width": truth.width.get(name, nan),
        }


def _base(cell: Cell, rows: pd.DataFrame) -> dict[str, object]:
    first = rows[rows.metric == "run"].iloc[0] if len(rows) else None
    outcome = first.outcome if first is not None else "not measured"
    return {
        "study": STUDY,
        "scenario": cell.scenario,
        "engine": cell.engine,
        "profile": cell.profile,
        "settings": " ".join(cell.changes),
        "dt": cell.dt,
        # A run that diverges at a coarse step is a measurement, not a fault.
        "verdict": "" if first is None or outcome == "diverged" else first.verdict,
        "outcome": outcome,
        "reason": first.reason if first is not None else "",
        "reproduce": line_of(cell, first is not None and "all effects" in first.reason),
    }


FRONT_COLUMNS = ("scenario", "quantity", "engine", "dominates", "factor", "where", "why")
"""`factor`: by how much the engine's best point is better than the reference's nearest, in time or in error
(at most 1 where the reference dominates); `where`: that point."""
ALMOST = 1.0
"""Factor up to which the reference dominates [1]."""


def fronts(table: pd.DataFrame) -> pd.DataFrame:
    """One row per scene, quantity and engine."""
    rows = []
    usable = table[table.time.notna() & (table.quantity != "")]
    for (scene, quantity), part in usable.groupby(["scenario", "quantity"], sort=False):
        floor = QUANTITIES[str(quantity)].floor
        ours = part[part.engine == REFERENCE]
        for engine, theirs in part[part.engine != REFERENCE].groupby("engine", sort=False):
            finite = theirs[theirs.error < float("inf")]
            if finite.empty:
                continue
            factors = deficit(ours[["time", "error"]].to_numpy(), finite[["time", "error"]].to_numpy(), floor)
            worst = finite.iloc[int(factors.argmax())]
            factor = float(factors.max())
            where = worst.reproduce.removeprefix("touchstone run ")
            why = "" if factor <= ALMOST else _why(str(scene), str(quantity), ours, worst)
            rows.append((scene, quantity, engine, factor <= ALMOST, factor, where, why))
    return pd.DataFrame(rows, columns=list(FRONT_COLUMNS))


def _why(scene: str, quantity: str, ours: pd.DataFrame, theirs: pd.Series) -> str:
    """Reason from the data: what the reference does not measure, where it is slower, where less accurate."""
    if ours.empty:
        driven = any(body.kind == "driven" for body in catalogue()[scene].bodies)
        return "the reference poses the avatar, so this is not defined" if driven else "not measured"
    faster = ours.time.min() > theirs.time
    better = ours.error.min() > max(theirs.error, QUANTITIES[quantity].floor)
    if faster and better:
        return "faster and more accurate than all settings of the reference"
    if faster:
        ratio = ours.time.min() / theirs.time
        return f"a setting {ratio:.3g} times as fast as the reference's fastest"
    if better:
        ratio = ours.error.min() / max(theirs.error, QUANTITIES[quantity].floor)
        return f"an error {ratio:.3g} times smaller than the reference's smallest"
    return "between two settings of the reference"


LADDER_COLUMNS = ("scenario", "change", "towards", "quantity", "unit", "before", "after", "time_ratio")
"""`before` and `after`: errors of `balanced` and of `balanced` with the change; `time_ratio`: its time over
that of `balanced`."""


def ladder(frame: pd.DataFrame, cells: Sequence[Cell]) -> pd.DataFrame:
    """Table of the ladder from the rows of the sweep: a row per scene, change and quantity; one round of
    timing."""
    if not cells:
        return pd.DataFrame(columns=list(LADDER_COLUMNS))
    names = list(dict.fromkeys(cell.scenario for cell in cells))
    plain = points(frame, grid(names, [(REFERENCE, BASE)]), 1)
    changed = points(frame, cells, 1)
    keys = ["scenario", "quantity", "unit"]
    both = changed.merge(plain, on=keys, suffixes=("", "_plain"))
    both = both[both.quantity.isin(QUANTITIES)]
    table = both[keys].copy()
    table["change"] = both.settings.where(both.settings != "", both.profile)
    table["before"], table["after"] = both.error_plain, both.error
    table["towards"] = table.change.map(changes()).fillna(both.profile)
    table["time_ratio"] = both.time / both.time_plain
    return table[list(LADDER_COLUMNS)].reset_index(drop=True)
