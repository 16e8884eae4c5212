"""Versions of this program compared: the same scenes played in the environment of each, and their table.

Play scenes on several released versions of an engine, and compare each with the first.

Every version plays in child processes of its own environment; recordings are judged here, by one judge. Each
round starts new processes, because a process's speed depends on where its memory lies. Within a round the
versions take turns, and the order changes from round to round.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd
from rich.text import Text

from touchstone.adapters.contract import Array
from touchstone.adapters.recording import Recording, load
from touchstone.adapters.workers.children import Children, Job
from touchstone.adapters.workers.environment import VersionError, VersionLoader, environment
from touchstone.adapters.workers.import_check import try_imports
from touchstone.adapters.workers.scratch import scratch_folder
from touchstone.reports.bootstrap import Interval, mean, restart_ratio
from touchstone.reports.changes import ACROSS_VERSIONS, SHOWN, changes
from touchstone.reports.metrics.solver import state_hash
from touchstone.reports.progress import SCENE, Progress
from touchstone.reports.results import Row, save, save_manifest, table
from touchstone.reports.run.study import job_of, judge_outcomes
from touchstone.reports.runner.request import Request, Results
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import number, scaled_number, unit_of
from touchstone.scenarios.plural import plural
from touchstone.scenarios.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Difference:
    """A version beside the first one in one scene and profile.

    Attributes:
        motion: largest distance between the positions of a body [m]; NaN where one of the two did not play
            to its end. 0 also where states differ in other ways than by position.
        same: whether all states of all frames are equal to the bit.
        time: ratio of the mean frame, with its interval; None where one of the two did not play.
    """

    scenario: str
    profile: str
    version: str
    motion: float
    same: bool
    time: Interval | None


@dataclass
class Compared:
    """Results per version, differences from the first version, and changed figures (`changes`) with a
    column `version`; `faults`: version -> why it did not play."""

    engine: str
    results: dict[str, Results]
    differences: list[Difference] = field(default_factory=list)
    figures: pd.DataFrame = field(default_factory=pd.DataFrame)
    faults: dict[str, str] = field(default_factory=dict)

    @property
    def frame(self) -> pd.DataFrame:
        """Long table of all versions, with the column `version`."""
        parts = [one.frame.assign(version=version) for version, one in self.results.items()]
        return pd.concat(parts, ignore_index=True) if parts else table([]).assign(version="")


def label_of(engine: str, version: str) -> str:
    """What children call a version of an engine."""
    return f"{engine}=={version}"


def environments(
    engine: str, versions: list[str], progress: Progress
) -> tuple[dict[str, Path | None], dict[str, str]]:
    """Environments of the versions that can be imported, and why others cannot."""
    folders: dict[str, Path | None] = {}
    faults = {}
    for version in versions:
        progress(f"environment of {engine} {version}", 1)
        try:
            folders[version] = environment(engine, version)
        except VersionError as error:
            faults[version] = str(error)
    with scratch_folder() as home:
        loader = _loader(engine, folders, home)
        for label, found in try_imports(tuple(loader.folders), loader).items():
            version = label.partition("==")[2]
            if found.status != "done":
                faults[version] = f"{engine} {version}: {found.text.removeprefix(f'{label}: ')}"
                del folders[version]
    return folders, faults


def _loader(engine: str, folders: Mapping[str, Path | None], home: Path) -> VersionLoader:
    return VersionLoader(engine, {label_of(engine, name): path for name, path in folders.items()}, home)


def compare(
    request: Request, folders: Mapping[str, Path | None], rounds: int, folder: Path, progress: Progress
) -> Compared:
    """Play all rounds, judge the first one, and compare; writes tables and recordings into `folder`.

    Args:
        request: scenes, and columns of one engine.
        folders: version -> its environment; None: the one that is installed.
    """
    engine = request.columns[0][0]
    found = Compared(engine, {version: Results(table([])) for version in folders})
    rows: dict[str, list[Row]] = {version: [] for version in folders}
    times: dict[tuple[str, str, str], list[Array]] = {}
    with scratch_folder() as scratch:
        for round_ in range(rounds):
            order = [*list(folders)[round_ % len(folders) :], *list(folders)[: round_ % len(folders)]]
            with Children(_loader(engine, folders, scratch)) as children:
                for number, scenario in enumerate(request.scenarios, start=1):
                    of = f"{number} of {len(request.scenarios)}"
                    progress(f"{SCENE}{of}: {scenario.name}, round {round_ + 1} of {rounds}", 0)
                    place = folder if round_ == 0 else scratch / str(round_)
                    outcomes = children.play(_jobs(request, scenario, order, place), progress)
                    for outcome in outcomes:
                        version = outcome.job.engine.partition("==")[2]
                        if outcome.status == "done":
                            key = (version, scenario.name, outcome.job.settings.label)
                            times.setdefault(key, []).append(load(outcome.job.recording).time_frame)
                    if round_ == 0:
                        # under the engine's own name: limits and known failings are found by it
                        for version, results in found.results.items():
                            mine = [
                                replace(one, job=replace(one.job, engine=engine))
                                for one in outcomes
                                if one.job.engine == label_of(engine, version)
                            ]
                            rows[version] += judge_outcomes(request, scenario, mine, results, progress)
    for version, results in found.results.items():
        results.frame = table(rows[version])
    first, *others = found.results
    for version in others:
        found.differences += _differences(found, first, version, times)
    found.figures = figures(found, first, others)
    _write(found, request, folder)
    return found


def _jobs(request: Request, scenario: Scenario, versions: list[str], folder: Path) -> list[Job]:
    jobs = []
    for version in versions:
        place = (folder / version).absolute()
        for name in ("recordings", "output"):
            (place / name).mkdir(parents=True, exist_ok=True)
        for engine, profile in request.columns:
            job = job_of(request, scenario, engine, profile, place)
            jobs.append(replace(job, engine=label_of(engine, version)))
    return jobs


def _differences(
    found: Compared, first: str, version: str, times: Mapping[tuple[str, str, str], list[Array]]
) -> list[Difference]:
    one, two = found.results[first].recordings, found.results[version].recordings
    every = dict.fromkeys([*found.results[first].ended, *one, *found.results[version].ended, *two])
    compared = []
    for key in every:
        scenario, _, label = key
        if key not in one or key not in two:
            compared.append(Difference(scenario, label, version, float("nan"), False, None))
            continue
        ours, theirs = times[version, scenario, label], times[first, scenario, label]
        count = min(map(len, (*ours, *theirs)))
        mine, others = (np.array([each[:count] for each in some]) for some in (ours, theirs))
        ratio = restart_ratio(mine, others, mean, np.arange(count))
        same = state_hash(one[key]) == state_hash(two[key])
        compared.append(Difference(scenario, label, version, distance(one[key], two[key]), same, ratio))
    return compared


def distance(one: Recording, two: Recording) -> float:
    """Largest distance between the positions of a body in two recordings of a scene [m]."""
    count = min(len(one.position), len(two.position))
    apart = np.linalg.norm(one.position[:count] - two.position[:count], axis=-1)
    return float(apart.max(initial=0.0))


def figures(found: Compared, first: str, others: list[str]) -> pd.DataFrame:
    """Figures that changed from the first version, with a column `version`; the worst kind first."""
    tables = {name: one.frame[one.frame.metric != "work"] for name, one in found.results.items()}
    found_in = {name: changes(tables[first], tables[name], ACROSS_VERSIONS)[SHOWN] for name in others}
    parts = [frame.assign(version=version) for version, frame in found_in.items()]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=["kind", "version"])


def _write(found: Compared, request: Request, folder: Path) -> None:
    for version, results in found.results.items():
        engines = results.recordings | results.ended
        manifest = {"engines": {"/".join(key): one.facts for key, one in engines.items()}}
        save(results.frame, folder / version)
        save_manifest(folder / version, {"command": request.command, "version": version, **manifest})
    save(found.frame, folder)
    found.figures.to_csv(folder / "changes.csv", index=False)
    facts = {"command": request.command, "engine": found.engine, "versions": list(found.results)}
    save_manifest(folder, facts | {"faults": found.faults})


SLOWER = 1.05
"""Ratio of times beyond which an interval counts as a change of speed, or its inverse [1]."""
MOST_FIGURES = 20
"""Changed figures that the terminal shows; `changes.csv` has all."""
SPEEDS = {"slower": "red", "faster": "green"}
KINDS = ("worse", "gone", "better", "changed")
FIGURE = ["scenario", "profile", "metric", "subject"]
HEADS = ("scene", "version", "motion [mm]", "worse", "gone", "better", "other", "time", "95 %")
NOTE = (
    "motion: largest distance of a body from its place in the first version; = all states are the same to "
    "the bit. worse, better, other: figures that moved by more than 1 %; gone: figures that it lacks. "
    "time: mean frame over that of the first version"
)


def speed(one: Difference) -> str:
    """`faster`, `slower` or empty: whether the interval of the ratio lies beyond 5 %."""
    if one.time is None:
        return ""
    if one.time.low > SLOWER:
        return "slower"
    return "faster" if one.time.high < 1 / SLOWER else ""


def sentences(found: Compared) -> Iterator[str]:
    """Two lines per version: physics and speed against the first."""
    first, *others = found.results
    for version in others:
        mine = [one for one in found.differences if one.version == version]
        if not mine:
            yield f"{version}: nothing to compare"
            continue
        yield f"{version}: physics: {'; '.join(_physics(found, mine, first))}"
        ratios = [one.time.value for one in mine if one.time is not None]
        if ratios:
            changed = {word: [one.scenario for one in mine if speed(one) == word] for word in SPEEDS}
            words = [f"{word} in {', '.join(dict.fromkeys(at))}" for word, at in changed.items() if at]
            middle = float(np.exp(np.mean(np.log(ratios))))
            remarks = "; ".join(words) or "no scene is clearly beyond 5 %"
            yield f"{version}: speed: frames take {middle:.2f} times as long as in {first}; {remarks}"


def _physics(found: Compared, mine: list[Difference], first: str) -> Iterator[str]:
    """What changed in the motion and the figures of a version."""
    ended = dict.fromkeys(one.scenario for one in mine if np.isnan(one.motion))
    moved = [one for one in mine if not one.same and one.scenario not in ended]
    same = sum(one.same for one in mine)
    yield f"the same to the bit as in {first}: {same} of {plural(len(mine), 'run')}"
    if moved:
        worst = max(moved, key=lambda one: one.motion)
        yield f"motion differs by up to {number(worst.motion * 1e3)} mm ({worst.scenario})"
    kinds = found.figures.kind[found.figures.version == mine[0].version]
    counts = [f"{int((kinds == kind).sum())} {kind}" for kind in KINDS if (kinds == kind).any()]
    if counts:
        yield f"figures: {', '.join(counts)}"
    if ended:
        yield f"did not play to the end: {', '.join(ended)}"


def report(found: Compared) -> list[Part]:
    """The differences, the figures that changed, and the sentences."""
    parts = []
    for profile in dict.fromkeys(one.profile for one in found.differences):
        mine = [one for one in found.differences if one.profile == profile]
        rows: list[list[str | Text]] = []
        for scene in dict.fromkeys(one.scenario for one in mine):
            lines = [_line(found, one) for one in mine if one.scenario == scene]
            rows += [["" if k else scene, *line] for k, line in enumerate(lines)]
        title = f"{found.engine} {profile} against {next(iter(found.results))}"
        parts.append(Part(title, HEADS, rows, words=2, tight=True))
    return [*parts, Part(notes=[NOTE] * bool(parts)), _figures(found), Part(lines=[*sentences(found)])]


def _line(found: Compared, one: Difference) -> list[Text | str]:
    places = found.figures[["version", "scenario", "profile"]]
    mine = found.figures[(places == [one.version, one.scenario, one.profile]).all(axis=1)]
    counts = [int((mine.kind == kind).sum()) for kind in KINDS]
    motion = "=" if one.same else "ended" if np.isnan(one.motion) else number(one.motion * 1e3)
    line = [one.version, motion, *(str(count) if count else "" for count in counts)]
    if one.time is None:
        return [*line, "-", "-"]
    ratio = Text(f"{one.time.value:.2f}", style=SPEEDS.get(speed(one), ""))
    return [*line, ratio, f"{one.time.low:.2f}-{one.time.high:.2f}"]


def _figures(found: Compared) -> Part:
    """The changed figures, the worst first, with the value of every version."""
    changed = found.figures[found.figures.kind.isin(KINDS)].copy()
    changed["order"] = changed.kind.map(KINDS.index)
    changed = changed.sort_values("order", kind="stable").drop_duplicates(FIGURE)
    versions = list(found.results)
    rows = []
    values = found.frame.set_index([*FIGURE, "version"]).value
    for row in changed.head(MOST_FIGURES).to_dict("records"):
        key = tuple(row[name] for name in FIGURE)
        figures = [float(values.get((*key, version), np.nan)) for version in versions]
        shown = ["-" if np.isnan(one) else scaled_number(key[2], one) for one in figures]
        unit = unit_of(key[2])
        name = f"{key[2]} {key[3]}".strip()
        rows.append([row["kind"], key[0], name, "" if unit == "1" else unit, *shown])
    rest = len(changed) - MOST_FIGURES
    notes = [f"{rest} more changed figures are in changes.csv"] if rest > 0 else []
    heads = ("", "scene", "figure", "unit", *versions)
    return Part("", heads, rows, notes, words=4, tight=True) if rows else Part()
