"""Search for the cheapest setting of an engine within limits, by successive halving.

Each round keeps the better half of the settings and plays as many new ones near them. With many scenes, early
rounds play some of them. Every play is a cell of the store, so an interrupted search goes on where it ended.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf
from pathlib import Path

import numpy as np
import pandas as pd

from touchstone.reports.cli.progress import Progress
from touchstone.reports.studies.tuning.space import Candidate, Space
from touchstone.reports.studies.work_precision.cheapest import TIME, Setting, cheapest
from touchstone.reports.studies.work_precision.definitions import (
    FINE,
    FINER,
    PERTURBED_SEEDS,
    QUANTITIES,
    TRUTH_ENGINE,
    TRUTH_PROFILE,
)
from touchstone.reports.studies.work_precision.errors import Truth, closed_path, errors_of, run_of, truth_of
from touchstone.reports.studies.work_precision.front import band
from touchstone.reports.studies.work_precision.points import reproduce
from touchstone.reports.sweep.cells import CATALOGUE, PERTURBED, TIMING, Cell
from touchstone.reports.sweep.content_hash import hash_of
from touchstone.reports.sweep.measures import FRAMES
from touchstone.reports.sweep.scenes import FILE, PERTURBED_FILE
from touchstone.reports.sweep.sweep import Executor, sweep
from touchstone.reports.sweep.timing_rounds import TimingRounds
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Scenario

ROUNDS = 4
"""Rounds of the search after the first."""
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
    best: Setting
    candidate: Candidate
    ablation: dict[str, Setting] = field(default_factory=dict)
    profiles: list[Setting] = field(default_factory=list)
    tried: int = 0


class NotMeasured(ValueError):
    """Nothing can be said: a quantity of the limits is in no scene, or no setting played to the end."""


class Search:
    """A search; `run` plays it."""

    def __init__(self, asked: Asked, progress: Progress) -> None:
        self._asked, self._progress = asked, progress
        self.space = Space(asked.engine, list(asked.scenes.values()))
        self._rng = np.random.default_rng(asked.seed)
        self._errors: dict[tuple[Candidate, str], tuple[dict[str, float], float]] = {}

    @property
    def truths(self) -> list[Cell]:
        """Converged solutions that the scenes without a closed form need."""
        found: list[Cell] = []
        for name, scenario in self._asked.scenes.items():
            if closed_path(scenario) is None or "events" in self._asked.limits:
                column = (name, TRUTH_ENGINE, TRUTH_PROFILE)
                plain, moved = sources_of(name)
                found += [Cell(*column, dt, source=plain) for dt in (FINE, FINER, 1 / 240)]
                found += [Cell(*column, 1 / 240, seed=k, source=moved) for k in PERTURBED_SEEDS]
        return found

    def run(self) -> Found:
        """Search, time the finalists, and put each setting of the best back.

        Raises:
            NotMeasured: see there.
        """
        asked, scenes = self._asked, list(self._asked.scenes)
        first = self.space.profiles()
        self._play(first, scenes)
        self._check(first)
        pool = self._tried(self.space.first(self._rng)[: max(len(first), asked.plays // 2)], self._some(0))
        for number in range(1, ROUNDS + 1):
            names, each = self._some(number), (asked.plays - asked.plays // 2) // ROUNDS
            kept = pool[: max(1, len(pool) // 2)][: max(2, asked.plays // 2 ** (number + 1))]
            new = [
                self.space.near(
                    kept[min(int(self._rng.exponential(len(kept) / 3)), len(kept) - 1)], kept, self._rng
                )
                for _ in range(each)
            ]
            pool = self._tried([*kept, *new], names)
        tried = len({candidate for candidate, _ in self._errors})
        finalists = self._tried(pool[: 2 * FINALISTS], scenes)[:FINALISTS]
        timed = self._timed(list(dict.fromkeys((*finalists, *first))))
        answer = cheapest(sorted((timed[one] for one in finalists), key=lambda s: s.time), asked.limits)
        assert answer is not None
        candidate = next(one for one in finalists if _same(timed[one], answer.best))
        changed = self.ablations(candidate)
        self._play(list(changed.values()), scenes)
        without = self._timed(list(dict.fromkeys(changed.values())))
        profiles = sorted((_rated(timed[one], asked.limits) for one in first), key=lambda s: s.excess)
        ablation = {
            text: _rated(without[one], asked.limits) for text, one in changed.items() if one in without
        }
        return Found(answer.met, answer.best, candidate, ablation, profiles, tried)

    def ablations(self, best: Candidate) -> dict[str, Candidate]:
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
            moved: Candidate = Candidate(plain.profile, best.dt)
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

    def _tried(self, candidates: Sequence[Candidate], names: Sequence[str]) -> list[Candidate]:
        """The candidates, best first."""
        distinct = list(dict.fromkeys(candidates))
        self._play(distinct, names)
        rated = [(one, self._rating(one, names)) for one in distinct]
        return [one for one, _ in sorted(rated, key=lambda pair: pair[1])]

    def _rating(self, candidate: Candidate, names: Sequence[str]) -> tuple[float, float]:
        """Excess over the limits, 1 where all are met, and time: lower is better."""
        setting = _rated(self._setting(candidate, names), self._asked.limits)
        return max(1.0, setting.excess), setting.time

    def _cell(self, candidate: Candidate, name: str) -> Cell:
        source, _ = sources_of(name)
        return Cell(
            name, self._asked.engine, candidate.profile, candidate.dt, candidate.changes, source=source
        )

    def _play(self, candidates: Sequence[Candidate], names: Sequence[str]) -> None:
        """Play what is not known yet."""
        keys = [(one, name) for one in candidates for name in names if (one, name) not in self._errors]
        cells = {key: self._cell(*key) for key in dict.fromkeys(keys)}
        if not cells:
            return
        rows = self._swept(list(cells.values()))
        for (candidate, name), cell in cells.items():
            scenario = self._asked.scenes[name]
            run = run_of(rows.get(hash_of(cell), _EMPTY), scenario)
            truth = self._truths[name] if run is not None else None
            if run is None or truth is None:
                self._errors[candidate, name] = ({}, inf)
            else:
                self._errors[candidate, name] = (errors_of(run, truth), float(run.frames.mean()))

    def _swept(self, cells: Sequence[Cell]) -> dict[str, pd.DataFrame]:
        asked = self._asked
        frame = sweep(
            cells, asked.store, jobs=asked.jobs, executor=asked.executor, progress=self._progress, series=True
        )
        return {str(key): part for key, part in frame.groupby("cell", sort=False)}

    @cached_property
    def _truths(self) -> dict[str, Truth | None]:
        cells = self.truths
        rows = self._swept(cells) if cells else {}
        found = {}
        for name, scenario in self._asked.scenes.items():
            mine = [run_of(rows.get(hash_of(c), _EMPTY), scenario) for c in cells if c.scenario == name]
            fine, finer, plain, *others = mine or [None] * 3
            runs = {"plain": [plain] if plain else [], "perturbed": [one for one in others if one]}
            found[name] = truth_of(scenario, fine, finer, runs)
        return found

    def _check(self, profiles: Sequence[Candidate]) -> None:
        """Raise NotMeasured if no profile has a quantity of the limits in any scene."""
        every = [self._errors[one, name][0] for one in profiles for name in self._asked.scenes]
        has = [name for name in QUANTITIES if any(name in errors for errors in every)]
        if not has:
            raise NotMeasured(
                f"no profile of {self._asked.engine} plays to the end, or nothing says what is true"
            )
        if gone := [name for name in self._asked.limits if name != TIME and name not in has]:
            raise NotMeasured(f"no {' and no '.join(gone)} is measured here; there is {', '.join(has)}")

    def _setting(self, candidate: Candidate, names: Sequence[str], times: Sequence[float] = ()) -> Setting:
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
        return Setting(*label, time, low, high, errors, 0.0, "", reproduce(where, False))

    def _timed(self, candidates: Sequence[Candidate]) -> dict[Candidate, Setting]:
        """Candidates with the times of their frames, alone on one core, each round with new processes."""
        names, rounds = list(self._asked.scenes), range(self._asked.timings)
        ended = [one for one in candidates if all(self._errors[one, name][0] for name in names)]
        cells = {
            (one, name, k): replace(self._cell(one, name), measure=TIMING, repeat=k)
            for k in rounds
            for one in ended
            for name in names
        }
        frame = sweep(
            list(cells.values()),
            self._asked.store,
            executor=TimingRounds,
            progress=self._progress,
            series=True,
        )
        rows = dict(iter(frame.groupby("cell", sort=False)))
        found = {}
        for one in candidates:
            times = []
            for k in rounds if one in ended else ():
                each = [_frame_time(rows.get(hash_of(cells[one, name, k]), _EMPTY)) for name in names]
                times.append(max(each))
            found[one] = self._setting(one, names, times)
        return found


def sources_of(name: str) -> tuple[str, str]:
    """Sources of a scene and of the same scene moved by a little: of the catalogue, or of a file."""
    return (CATALOGUE, PERTURBED) if name in catalogue() else (FILE, PERTURBED_FILE)


_EMPTY = pd.DataFrame({"outcome": [], "metric": [], "series": []})


def _frame_time(rows: pd.DataFrame) -> float:
    """Mean time of the frames of a timing cell [s]; infinite if it has none."""
    series = [s for m, s in zip(rows.metric, rows.series) if m == FRAMES]
    return float(np.mean(series[0])) if series and len(series[0]) else inf


def _rated(setting: Setting, limits: Mapping[str, float]) -> Setting:
    answer = cheapest([setting], limits)
    assert answer is not None
    return answer.best


def _same(one: Setting, other: Setting) -> bool:
    keys = ("profile", "settings", "dt")
    return all(getattr(one, key) == getattr(other, key) for key in keys)
