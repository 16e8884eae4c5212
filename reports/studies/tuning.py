"""Search for the cheapest setting of an engine within limits, by successive halving.

Each round keeps the better half of the settings and plays as many new ones near them. With many scenes, early
rounds play some of them. Every play is a cell of the store, so an interrupted search goes on where it ended.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf, isfinite
from pathlib import Path

import numpy as np

from touchstone.adapters.contract import AdapterError, Settings
from touchstone.adapters.knobs import Choice, Numbers, Range, Setting, split
from touchstone.adapters.recorder import substeps
from touchstone.adapters.registry import ENGINES, settings_of
from touchstone.adapters.scripts.process import settings_lines
from touchstone.reports.progress import Progress
from touchstone.reports.runner.cells import CATALOGUE, FILE, PERTURBED, PERTURBED_FILE, Cell
from touchstone.reports.runner.measures import closed_path
from touchstone.reports.runner.request import line_of
from touchstone.reports.runner.sweep import Executor, InTurns, sweep
from touchstone.reports.studies.study import RefusedError
from touchstone.reports.studies.work_precision.points import (
    QUANTITIES,
    SweptRuns,
    TrueMotion,
    band,
    errors_of,
    timing_cell,
    truth_cells,
)
from touchstone.reports.studies.work_precision.study import (
    TIME,
    MeasuredSetting,
    cheapest,
    margins,
    number,
    rated,
    setting_row,
    words_of,
)
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.plural import plural
from touchstone.scenarios.scenario import Scenario

FACTORS = (0.1, 0.25, 0.5, 2.0, 4.0, 10.0)
"""What a number of a profile is multiplied by [1]."""
SHARES = (0.1, 0.01, 1e-4, 1e-6)
"""Shares of the largest value of a number that is zero in every profile [1]."""
COUNTS = (1, 3, 10, 30, 100, 300)
"""Values of a whole number that is zero, or depends on the scene, in every profile."""
SMALL = (1e-4, 1e-6, 1e-8, 1e-10)
"""Values of a number that depends on the scene in every profile."""
TOWARDS = 0.8
"""Share of the way to a bound by which one of several numbers is moved [1]."""
LADDER = (1, 2, 4, 8, 16, 32, 64)
"""Steps of a frame of 1/60 s that are tried; a scene of another rate has as many a frame."""


class Space:
    """Candidates of an engine in scenes."""

    def __init__(self, engine: str, scenarios: Sequence[Scenario]) -> None:
        self.engine, self._table = engine, settings_of(engine)
        self._profiles = ENGINES[engine].profiles
        rungs = (1 / (60 * k) for k in LADDER)
        self.steps = [dt for dt in rungs if all(_divides(scenario, dt) for scenario in scenarios)]
        self._texts = [text for one in self._table.values() for text in values_of(one)]

    def profiles(self) -> list[Settings]:
        """Every profile at its own step."""
        return list(dict.fromkeys(Settings(name, dt) for name, dt in self._profiles.items()))

    def first(self, rng: np.random.Generator) -> list[Settings]:
        """Every profile at its step, then in drawn order: every profile at every step, and after each two
        settings changed alone in the first profile. `equal-step` is another profile at one step."""
        name, dt = next(iter(self._profiles.items()))
        steps = [Settings(one, step) for one in self._profiles if one != "equal-step" for step in self.steps]
        alone = [one for text in self._texts if (one := self.changed(Settings(name, dt), text))]
        for several in (steps, alone):
            rng.shuffle(several)
        found = self.profiles()
        while steps or alone:
            found += [*steps[:1], *alone[:2]]
            del steps[:1], alone[:2]
        return list(dict.fromkeys(found))

    def changed(self, candidate: Settings, text: str) -> Settings | None:
        """A candidate with one more change, or another value of a changed one; None if it does nothing."""
        others = [one for one in candidate.changes if split(one)[0] != split(text)[0]]
        try:
            changes = self._table.changes(candidate.profile, (*others, text))
        except AdapterError:
            return None
        found = Settings(candidate.profile, candidate.dt, changes)
        return None if found == candidate else found

    def near(self, candidate: Settings, others: Iterable[Settings], rng: np.random.Generator) -> Settings:
        """A candidate that differs in one thing: a change of another good one, a value, or the step."""
        known = list(others)
        for _ in range(20):
            kind = int(rng.integers(4))
            found: Settings | None = None
            if kind == 0 and self.steps:
                found = replace(candidate, dt=self.steps[int(rng.integers(len(self.steps)))])
            elif kind == 1 and known:
                found = self._joined(candidate, known[int(rng.integers(len(known)))])
            elif kind == 2 and candidate.changes:
                text = candidate.changes[int(rng.integers(len(candidate.changes)))]
                values = values_about(self._table[split(text)[0]], split(text)[1])
                found = self.changed(candidate, values[int(rng.integers(len(values)))]) if values else None
            elif self._texts:
                found = self.changed(candidate, self._texts[int(rng.integers(len(self._texts)))])
            if found is not None and found != candidate:
                return found
        return candidate

    def _joined(self, candidate: Settings, other: Settings) -> Settings | None:
        found: Settings | None = candidate
        for text in other.changes:
            found = (found and self.changed(found, text)) or found
        return found


def values_of(setting: Setting) -> list[str]:
    """Values of a setting as "key=value": all of a choice; of a number, around those of the profiles."""
    plain = list(dict.fromkeys(value for value in setting.profiles if value))
    if isinstance(setting, Choice):
        return [f"{setting.name}={value}" for value in setting.values]
    found = [text for value in plain for text in values_about(setting, value)]
    if isinstance(setting, Range) and not any(float(value) for value in plain):
        if setting.whole:
            values: Sequence[float] = COUNTS
        else:
            values = SMALL if not plain else [share * setting.most for share in SHARES]
        found += _valid(setting, values)
    return list(dict.fromkeys((*found, *(f"{setting.name}={value}" for value in plain))))


def values_about(setting: Setting, value: str) -> list[str]:
    """Values near one of a number, or of several numbers; other choices."""
    if isinstance(setting, Choice):
        return [f"{setting.name}={one}" for one in setting.values if one != value]
    if isinstance(setting, Range):
        return _valid(setting, [float(value) * factor for factor in FACTORS])
    assert isinstance(setting, Numbers)
    numbers, found = setting.number(value), []
    for k, (least, most) in enumerate(setting.bounds):
        for bound in (least, most):
            if isfinite(bound):
                moved = [*numbers]
                moved[k] = min(max(float(f"{numbers[k] + TOWARDS * (bound - numbers[k]):.4g}"), least), most)
                found.append(f"{setting.name}={setting.word(moved)}")
    return found


def _valid(setting: Range, values: Iterable[float]) -> list[str]:
    inside = [min(max(value, setting.least), setting.most) for value in values]
    rounded = [round(one) if setting.whole else float(f"{one:.4g}") for one in inside]
    return [f"{setting.name}={setting.word(one)}" for one in dict.fromkeys(rounded)]


def _divides(scenario: Scenario, dt: float) -> bool:
    try:
        substeps(scenario, dt)
    except ValueError:
        return False
    return True


ROUNDS = 4
DRAWS = 20
"""Largest number of draws for each new setting [1]."""
FINALISTS = 3
"""Settings that are timed at the end, alone on one core, beside those of the ablation."""
SOME_SCENES = 6
"""Scenes up to which every round plays all."""


@dataclass(frozen=True, slots=True)
class Asked:
    """What is searched.

    Attributes:
        scenes: "name of the catalogue", or a file -> its scene.
        limits: by quantity [SI], and TIME for the frame [s].
        plays: settings that are tried.
        timings: rounds of timing at the end.
    """

    engine: str
    scenes: Mapping[str, Scenario]
    limits: Mapping[str, float]
    plays: int
    timings: int
    seed: int
    store: Path
    jobs: int | None = None
    executor: Callable[[Path], Executor] | None = None


@dataclass(slots=True)
class Found:
    """The best setting, and what it is compared with.

    Attributes:
        met: whether `best` is within all limits, or the nearest.
        ablation: what is put back -> the setting without it.
        profiles: the engine's profiles as they are, by their excess.
    """

    met: bool
    best: MeasuredSetting
    candidate: Settings
    ablation: dict[str, MeasuredSetting] = field(default_factory=dict)
    profiles: list[MeasuredSetting] = field(default_factory=list)
    tried: int = 0


class Search:
    """A search; `run` plays it."""

    def __init__(self, asked: Asked, progress: Progress) -> None:
        self._asked, self._progress = asked, progress
        self.space = Space(asked.engine, list(asked.scenes.values()))
        self._rng = np.random.default_rng(asked.seed)
        self._errors: dict[tuple[Settings, str], tuple[dict[str, float], float]] = {}

    @property
    def truths(self) -> list[Cell]:
        """Converged solutions that the scenes without a closed form need."""
        found: list[Cell] = []
        for name, scenario in self._asked.scenes.items():
            if closed_path(scenario) is None or "events" in self._asked.limits:
                found += truth_cells(name, sources_of(name))
        return found

    def run(self) -> Found:
        """Search, time the finalists, and put each setting of the best back.

        Raises:
            RefusedError: a quantity of the limits is in no scene, or no setting played to the end.
        """
        asked, scenes = self._asked, list(self._asked.scenes)
        first = self.space.profiles()
        self._play(first, scenes)
        self._check(first)
        pool = self._tried(self.space.first(self._rng)[: max(len(first), asked.plays // 2)], self._some(0))
        for round_ in range(1, ROUNDS + 1):
            names, count = self._some(round_), (asked.plays - len(self._known)) // (ROUNDS + 1 - round_)
            kept = pool[: max(1, len(pool) // 2)][: max(2, asked.plays // 2 ** (round_ + 1))]
            pool = self._tried([*kept, *self._new(kept, count)], names)
        tried = len(self._known)
        finalists = self._tried(pool[: 2 * FINALISTS], scenes)[:FINALISTS]
        timed = self._timed(list(dict.fromkeys((*finalists, *first))))
        answer = cheapest(sorted((timed[one] for one in finalists), key=lambda s: s.time), asked.limits)
        assert answer is not None
        best = answer.best
        keys = {one: (timed[one].profile, timed[one].settings, timed[one].dt) for one in finalists}
        candidate = next(one for one in finalists if keys[one] == (best.profile, best.settings, best.dt))
        changed = self.ablations(candidate)
        self._play(list(changed.values()), scenes)
        without = self._timed(list(dict.fromkeys(changed.values())))
        profiles = sorted((rated(timed[one], asked.limits) for one in first), key=lambda s: s.excess)
        left = {text: without[one] for text, one in changed.items() if one in without}
        ablation = {text: rated(one, asked.limits) for text, one in left.items()}
        return Found(answer.met, answer.best, candidate, ablation, profiles, tried)

    @property
    def _known(self) -> set[Settings]:
        return {candidate for candidate, _ in self._errors}

    def _new(self, kept: Sequence[Settings], count: int) -> list[Settings]:
        """`count` settings near those kept, mostly the better ones, that were not played; fewer where DRAWS
        for each find no more."""
        known, found = self._known, dict[Settings, None]()
        for _ in range(DRAWS * count):
            if len(found) == count:
                break
            one = kept[min(int(self._rng.exponential(len(kept) / 3)), len(kept) - 1)]
            near = self.space.near(one, kept, self._rng)
            found |= {} if near in known else {near: None}
        return list(found)

    def ablations(self, best: Settings) -> dict[str, Settings]:
        """What is put back to the engine's default -> the best setting without it."""
        entry = self.space.profiles()
        plain = next((one for one in entry if one.profile == "default"), entry[0])
        found = {
            f"without {text}": replace(best, changes=tuple(one for one in best.changes if one != text))
            for text in best.changes
        }
        if best.dt != plain.dt:
            found["at the default step"] = replace(best, dt=plain.dt)
        if best.profile != plain.profile:
            moved: Settings = Settings(plain.profile, best.dt)
            for text in best.changes:
                moved = self.space.changed(moved, text) or moved
            found[f"profile {plain.profile} instead of {best.profile}"] = moved
        return found

    def _some(self, number: int) -> list[str]:
        """Scenes of a round: more and more of them."""
        names = list(self._asked.scenes)
        if len(names) <= SOME_SCENES:
            return names
        count = min(len(names), -(-len(names) * (number + 1) // (ROUNDS + 1)))
        order = np.random.default_rng(self._asked.seed).permutation(len(names))[:count]
        return [names[k] for k in sorted(order)]

    def _tried(self, candidates: Sequence[Settings], names: Sequence[str]) -> list[Settings]:
        distinct = list(dict.fromkeys(candidates))
        self._play(distinct, names)
        scored = [(one, self._rating(one, names)) for one in distinct]
        return [one for one, _ in sorted(scored, key=lambda pair: pair[1])]

    def _rating(self, candidate: Settings, names: Sequence[str]) -> tuple[float, float]:
        """Excess over the limits, 1 where all are met, and time: lower is better."""
        setting = rated(self._setting(candidate, names), self._asked.limits)
        return max(1.0, setting.excess), setting.time

    def _cell(self, candidate: Settings, name: str) -> Cell:
        how = candidate.profile, candidate.dt, candidate.changes
        return Cell(name, self._asked.engine, *how, source=sources_of(name)[0])

    def _play(self, candidates: Sequence[Settings], names: Sequence[str]) -> None:
        keys = [(one, name) for one in candidates for name in names if (one, name) not in self._errors]
        cells = {key: self._cell(*key) for key in dict.fromkeys(keys)}
        if not cells:
            return
        swept = self._swept(list(cells.values()))
        for (candidate, name), cell in cells.items():
            run = swept.run(cell)
            truth = self._truths[name] if run is not None else None
            if run is None or truth is None:
                self._errors[candidate, name] = ({}, inf)
            else:
                self._errors[candidate, name] = (errors_of(run, truth), float(run.frames.mean()))

    def _swept(self, cells: Sequence[Cell]) -> SweptRuns:
        store, jobs, executor = self._asked.store, self._asked.jobs, self._asked.executor
        rows = sweep(cells, store, jobs=jobs, executor=executor, progress=self._progress, series=True)
        return SweptRuns(rows)

    @cached_property
    def _truths(self) -> dict[str, TrueMotion | None]:
        cells = self.truths
        swept = self._swept(cells)
        return {
            name: swept.truth(scenario, [cell for cell in cells if cell.scenario == name])
            for name, scenario in self._asked.scenes.items()
        }

    def _check(self, profiles: Sequence[Settings]) -> None:
        """Refuse if no profile has a quantity of the limits in any scene."""
        every = [self._errors[one, name][0] for one in profiles for name in self._asked.scenes]
        has = [name for name in QUANTITIES if any(name in errors for errors in every)]
        if not has:
            engine = self._asked.engine
            raise RefusedError(f"no profile of {engine} plays to the end, or nothing says what is true")
        if gone := [name for name in self._asked.limits if name != TIME and name not in has]:
            raise RefusedError(f"no {' and no '.join(gone)} is measured here; there is {', '.join(has)}")

    def _setting(
        self, candidate: Settings, names: Sequence[str], times: Sequence[float] = ()
    ) -> MeasuredSetting:
        """A candidate with its worst errors and its longest frame over scenes."""
        known = [self._errors[candidate, name] for name in names]
        errors = {
            quantity: max(inf if not found else found.get(quantity, 0.0) for found, _ in known)
            for quantity in self._asked.limits
            if quantity != TIME
        }
        time, low, high = band(times) if times else (max(time for _, time in known),) * 3
        where = self._cell(candidate, next(iter(self._asked.scenes)))
        label = self._asked.engine, candidate.profile, " ".join(candidate.changes), candidate.dt
        return MeasuredSetting(*label, time, low, high, errors, 0.0, "", line_of(where))

    def _timed(self, candidates: Sequence[Settings]) -> dict[Settings, MeasuredSetting]:
        """Candidates with the times of their frames, alone on one core, each round with new processes."""
        names, rounds = list(self._asked.scenes), range(self._asked.timings)
        ended = [one for one in candidates if all(self._errors[one, name][0] for name in names)]
        cells = {(one, name): self._cell(one, name) for one in ended for name in names}
        asked = [timing_cell(cell, k) for k in rounds for cell in cells.values()]
        timed = sweep(asked, self._asked.store, executor=InTurns, progress=self._progress, series=True)
        swept = SweptRuns(timed)
        found = {}
        for one in candidates:
            times = []
            for k in rounds if one in ended else ():
                each = [swept.frames(cells[one, name], k) for name in names]
                times.append(max(float(frames.mean()) if len(frames) else inf for frames in each))
            found[one] = self._setting(one, names, times)
        return found


def sources_of(name: str) -> tuple[str, str]:
    """Sources of a scene and of the same scene moved by a little: of the catalogue, or of a file."""
    return (CATALOGUE, PERTURBED) if name in catalogue() else (FILE, PERTURBED_FILE)


def cost_lines(asked: Asked) -> list[str]:
    """What is about to be played."""
    seconds = sum(scenario.duration for scenario in asked.scenes.values())
    search = Search(asked, lambda label, cells: None)
    truths, plays = len(search.truths), max(asked.plays, len(search.space.profiles()))
    also = f", {plural(truths, 'play')} of the reference for what is true" if truths else ""
    first, *others = asked.scenes.values()
    scenes = f"{len(asked.scenes)} scenes" if others else first.name
    return [
        f"tune {scenes} on {asked.engine}: {plays} settings of {seconds:g} simulated seconds{also}; "
        f"Ctrl-C keeps what was played in {asked.store}"
    ]


def lines_to_paste(asked: Asked, found: Found) -> list[str]:
    """Lines that set the best setting in the engine's own API, as in the scripts of `reproduce`."""
    several = [settings_lines(scene, asked.engine, [found.candidate])[0] for scene in asked.scenes.values()]
    return list(dict.fromkeys(line for part in several for line in part))


def tuned_lines(asked: Asked, found: Found, pasted: list[str]) -> list[str]:
    """The answer as text."""
    best = found.best
    head = "best" if found.met else "no setting reaches the limits; nearest"
    every = "" if found.tried >= asked.plays else ", all that differ"
    text = [f"{head} of {found.tried} settings{every}: {words_of(best)}"]
    text += [f"  {margins(best, asked.limits)}", "to paste:"]
    text += [f"  {line}" for line in pasted]
    if found.ablation:
        text.append("what each setting does, put back to the default:")
        text += [f"  {what}: {compared(one, best, asked.limits)}" for what, one in found.ablation.items()]
    text.append("profiles as they are:")
    text += [f"  {words_of(one)}; {margins(one, asked.limits)}" for one in found.profiles]
    text.append(f"again: {best.command}")
    if len(asked.scenes) == 1:
        text.append(f"as a script: {best.command.replace('touchstone run', 'touchstone reproduce')}")
    return text


def compared(one: MeasuredSetting, best: MeasuredSetting, limits: Mapping[str, float]) -> str:
    """Errors and time of a setting, and over those of the best."""
    if not isfinite(one.excess):
        return "does not play to the end, or lets bodies pass through each other"
    parts = []
    for name in [*(name for name in limits if name != TIME), TIME]:
        value, other = (s.time if name == TIME else s.errors[name] for s in (one, best))
        unit = "s" if name == TIME else QUANTITIES[name].unit
        ratio = f" ({value / other:.3g} times)" if other else ""
        parts.append(f"{name} {number(value, unit)}{ratio}")
    return "; ".join(parts)


def tuned_rows(asked: Asked, found: Found, pasted: list[str]) -> list[dict[str, object]]:
    """The best setting, its ablation and the profiles, a row each (`setting_row`)."""
    places = [("best" if found.met else "nearest", found.best), *found.ablation.items()]
    places += [("profile", one) for one in found.profiles]
    return [
        setting_row(place, one, asked.limits, excess=one.excess if isfinite(one.excess) else None)
        | {"paste": "\n".join(pasted) if one is found.best else ""}
        for place, one in places
    ]
