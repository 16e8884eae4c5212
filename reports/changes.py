"""Stored runs and what changed between two of them, by the tolerances of times that several show.

Tolerances of times, measured: how far apart the times of runs of one program on one machine are.

`times.toml` has those that `touchstone compare` takes unless a file says otherwise. Measure it again by
several runs, `touchstone run SCENES --out runs/K`, and

    touchstone tolerances runs/1 runs/2 ... --out times.toml && mv times.toml reports

What changed from one set of rows to another, beyond intervals, limits and tolerances.

A row is worse if its verdict is, or if its value moved away from 0 by more than its tolerance while it has
no limit or breaks it: signed metrics are errors, whose truth is 0. Within a limit nothing is worse. Where
both values have intervals, they must be apart. A value whose metric has no better side has changed. What the
later run lacks is gone: a scene, an engine, a figure, or a column of other settings or another step.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from functools import cache
from itertools import combinations
from math import ceil, inf, isfinite, isinf
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import pyarrow
from pydantic import BaseModel, Field, Strict

from touchstone.adapters.contract import MISSING, UNIMPORTABLE
from touchstone.adapters.recording import Recording, RecordingError, load
from touchstone.adapters.registry import recalled
from touchstone.reports.machine import machine
from touchstone.reports.metrics import METRICS
from touchstone.reports.results import COLUMNS, NUMBERS, UNJUDGED
from touchstone.reports.runner.request import step_text
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import quantity, shown_unit
from touchstone.scenarios.files.read import SceneFileError, data_of_file
from touchstone.scenarios.plural import plural

NEEDED = (
    *("study", "scenario", "engine", "profile", "metric", "subject", "verdict", "reason", "unit"),
    *NUMBERS,
)
"""Columns that every version has written."""
TABLES = ("results.parquet", "results.csv")


class RunError(ValueError):
    """A folder holds no results; the message says what is missing."""


def table_of(folder: Path) -> pd.DataFrame:
    """Long table of a run, with the columns of `results.COLUMNS`; raises RunError."""
    if not folder.is_dir():
        raise RunError(f"{folder}: no such folder")
    path = next((folder / name for name in TABLES if (folder / name).is_file()), None)
    if path is None:
        raise RunError(f"{folder}: holds neither {' nor '.join(TABLES)}")
    try:
        frame = pd.read_parquet(path) if path.suffix == ".parquet" else pd.read_csv(path)
    except (OSError, ValueError, pyarrow.ArrowException) as error:
        raise RunError(f"{path}: cannot be read: {f'{error}'.partition(chr(10))[0][:100]}") from error
    if missing := [name for name in NEEDED if name not in frame]:
        raise RunError(f"{path}: no columns {', '.join(missing)}")
    for name in NUMBERS:
        try:
            frame[name] = pd.to_numeric(frame[name])
        except (ValueError, TypeError) as error:
            raise RunError(f"{path}: {name}: expected numbers") from error
    texts = [name for name in COLUMNS if name not in NUMBERS]
    frame = frame.reindex(columns=list(COLUMNS))  # an older table lacks newer columns
    frame[texts] = frame[texts].astype(object).fillna("").astype(str)
    return frame


def recordings_of(folder: Path) -> Iterator[tuple[Path, Recording]]:
    """Recordings of a run with their paths; raises RunError if there are none or one cannot be read."""
    if not folder.is_dir():
        raise RunError(f"{folder}: no such folder")
    paths = sorted((folder / "recordings").glob("*.npz"))
    if not paths:
        raise RunError(f"{folder}: no recordings; expected recordings/*.npz")
    for path in paths:
        try:
            yield path, load(path)
        except RecordingError as error:
            raise RunError(str(error)) from error


def label_of(path: Path, recording: Recording) -> tuple[str, str, str]:
    """Scene, engine and label (profile and what was changed in it) of a recording, from its file's name; the
    engine is registered."""
    scene = str(json.loads(recording.scenario)["name"])
    facts = recording.facts
    engine, profile = recalled(str(facts["engine"])), str(facts["profile"])
    rest = path.stem.removeprefix(f"{scene}-{engine}-")
    changed = rest.removeprefix(profile) if rest.startswith(profile) else ""
    return scene, engine, profile + changed.replace("+", ", ", 1)


MARGIN = 1.25
"""Ratio of a tolerance to the largest difference that was measured [1]: further runs may exceed it."""
SAME = 1e-9
"""Relative difference of other figures between runs of one program [1]: they repeat to the bit."""
PATTERNS = {"time.": "time.*", "ratio.time": "ratio.time*"}
"""Times that were not measured, such as those of studies: pattern per start."""
HEADS = ("metric", "rows", "median", "largest", "tolerance")


def differences(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Differences of times over all pairs of runs, relative to the larger time: columns HEADS [1].

    Args:
        tables: name -> long table of a run.
    Raises:
        RunError: runs that differ in more than times, or have no time in common.
    """
    ones = {name: frame.drop_duplicates(KEY) for name, frame in tables.items()}
    ones = {name: one.assign(dt=one.dt.fillna(0.0).round(12)).set_index(KEY) for name, one in ones.items()}
    joined = pd.concat([one.value.rename(name) for name, one in ones.items()], axis=1, join="inner")
    timed = joined.index.get_level_values("metric").str.startswith(TIMED)
    _check_same(joined[~timed])
    times = joined[timed].dropna()
    if times.empty:
        raise RunError(f"{' '.join(tables)}: no time in common")
    apart = (times.max(axis=1) - times.min(axis=1)) / times.abs().max(axis=1)
    pairs = pd.concat(
        [(times[a] - times[b]).abs() / times[[a, b]].abs().max(axis=1) for a, b in combinations(tables, 2)]
    )
    found = pd.DataFrame(
        {
            "rows": apart.groupby(level="metric").size(),
            "median": pairs.fillna(0.0).groupby(level="metric").median(),
            "largest": apart.fillna(0.0).groupby(level="metric").max(),
        }
    ).reset_index()
    rounded = [ceil(round(100 * MARGIN * value, 6)) / 100 for value in found.largest]
    found["tolerance"] = [one if one < 1 else inf for one in rounded]  # inf covers any difference
    return found[list(HEADS)]


def _check_same(others: pd.DataFrame) -> None:
    """Raise RunError if figures that no clock measures differ: more than chance lies between such runs."""
    low, high = others.min(axis=1), others.max(axis=1)
    size = others.abs().max(axis=1)
    apart = (high - low) > SAME * size
    if apart.any():
        _, scene, engine, profile, *_, metric, _ = others.index[apart][0]
        raise RunError(
            f"{' '.join(others.columns)}: {metric} of {scene} on {engine} {profile} differs; tolerances of "
            "times need runs of one program"
        )


def toml_of(found: pd.DataFrame, runs: Sequence[str]) -> str:
    """A file for `--tolerance`, with what was measured in its comments."""
    where = "{processor}, {cores} cores".format(**machine())
    lines = [
        f"# Written by `touchstone tolerances {' '.join(runs)}`.",
        f"# {len(runs)} runs of one program, {where}: {MARGIN} times the largest difference, relative to the",
        "# larger time. inf: runs differ by so much that nothing is judged.",
    ]
    for start, pattern in PATTERNS.items():
        mine = found[found.metric.str.startswith(start)]
        if len(mine):
            lines += ["", "[[tolerances]] # times that were not measured", f'metric = "{pattern}"']
            lines += [f"relative = {_number(mine.tolerance.max())}"]
    for row in found.to_dict("records"):
        lines += [
            "",
            f"[[tolerances]] # {plural(row['rows'], 'row')}: "
            f"largest {row['largest']:.2f}, median {row['median']:.3f}",
        ]
        lines += [f'metric = "{row["metric"]}"', f"relative = {_number(row['tolerance'])}"]
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    return f"{value:g}" if isfinite(value) else "inf"


RUN = ["study", "scenario", "engine", "profile", "dt", "seed", "repeat"]
KEY = [*RUN, "metric", "subject"]
RANK = {
    "": 0,
    "pass": 0,
    "known": 1,
    "skipped": 1,
    MISSING: 2,
    UNIMPORTABLE: 2,
    UNJUDGED: 2,
    "fail": 3,
    "error": 4,
}
FAILED = RANK["fail"]
TIMED = ("time.", "ratio.time")
"""Starts of the names of metrics that a clock measures."""
ONE_SIDED = "in one run only"
ABSENT = (MISSING, UNIMPORTABLE)
"""Verdicts of runs that did not take place."""
KINDS = ("worse", "gone", "changed", "better", "new")
FAILING = ("worse", "gone")
SHOWN = ["kind", *KEY, "a", "b", "unit", "verdict_a", "verdict_b", "reason"]
ROW, VERDICT, VALUE = "row", "verdict", "value"
"""What changed: one side lacks the row, the verdict is another, or the value."""


Size = Annotated[float, Strict(), Field(ge=0)]


class Tolerance(BaseModel, frozen=True, extra="forbid"):
    """Largest difference of a metric's values, `absolute` [unit of the metric] plus `relative` times the
    larger value; patterns such as `time.*` for metric, engine and scenario. The last that fits holds."""

    metric: str
    relative: Size = 0.0
    absolute: Size = 0.0
    engine: str = "*"
    scenario: str = "*"

    def fits(self, metric: str, engine: str, scenario: str) -> bool:
        """Whether it holds for a row."""
        asked = ((metric, self.metric), (engine, self.engine), (scenario, self.scenario))
        return all(fnmatchcase(name, pattern) for name, pattern in asked)

    def covers(self, a: float, b: float) -> bool:
        """Whether two values differ by no more."""
        return isinf(self.relative) or abs(b - a) <= self.absolute + self.relative * max(abs(a), abs(b))


class Tolerances(BaseModel, extra="forbid"):
    """A file of tolerances."""

    tolerances: tuple[Tolerance, ...]


FILE = Path(__file__).with_name("times.toml")
"""Tolerances of times of one program, as `changes.py` measures them."""
FIGURES = Tolerance(metric="*", relative=1e-6, absolute=1e-9)
"""Of all figures but times: engines repeat them to the bit on one machine; others round otherwise."""
PROGRAMS = Tolerance(metric="*", relative=1e-2, absolute=1e-9)
"""Of figures of other programs or platforms, after rounding over some hundred frames."""
ACROSS_NIGHTS = (PROGRAMS, *(Tolerance(metric=times, relative=inf) for times in ("time.*", "ratio.time*")))
"""Of nights, whose times have a history."""
ACROSS_VERSIONS = (PROGRAMS, *(Tolerance(metric=name, relative=inf) for name in ("time*", "state.hash")))
"""Of versions of an engine, whose times are compared over several rounds, and states by their distance."""


@cache
def default() -> tuple[Tolerance, ...]:
    """Tolerances unless a file says otherwise: FIGURES, then the measured ones of times."""
    return (FIGURES, *_of_file(FILE))


def tolerances(path: Path | None) -> tuple[Tolerance, ...]:
    """Default tolerances, then those of a TOML or JSON file: an array `tolerances` with the fields of
    `Tolerance`.

    Raises:
        SceneFileError: the file is not valid; one line per fault.
    """
    return default() if path is None else (*default(), *_of_file(path))


def _of_file(path: Path) -> tuple[Tolerance, ...]:
    data, faults, message_of = data_of_file(path, Tolerances)
    if faults:
        raise SceneFileError(message_of(faults))
    return Tolerances.model_validate(data).tolerances


def tolerance_of(all_of_them: tuple[Tolerance, ...], metric: str, engine: str, scenario: str) -> Tolerance:
    """The last tolerance that fits a row."""
    return next(one for one in reversed(all_of_them) if one.fits(metric, engine, scenario))


def changes(
    a: pd.DataFrame, b: pd.DataFrame, allowed: tuple[Tolerance, ...], by_profile: bool = False
) -> pd.DataFrame:
    """Rows that changed from table `a` to table `b`, with columns SHOWN, `why` (ROW, VERDICT or
    VALUE) and `limit` of `b`; the worst kind first.

    Runs that only one of the tables has, such as other scenes, are one row each: new or gone. Figures of a
    new run that fail are worse.

    Args:
        by_profile: compare columns of one profile, whatever their settings and steps are.
    Raises:
        RunError: under `by_profile`, a table has several columns of one scene, engine and profile.
    """
    gone = b[b.verdict.isin(ABSENT)].to_dict("records")
    reasons = {_column(tuple(r[name] for name in RUN)): f"{r['verdict']}: {r['reason']}" for r in gone}
    a, b = _keyed(a, by_profile), _keyed(b, by_profile)
    both = a.merge(b, how="outer", on=KEY, suffixes=("_a", "_b"), indicator=True)
    runs_a, runs_b = (set(frame[RUN].itertuples(index=False, name=None)) for frame in (a, b))
    failed_b = b.metric.eq("run") & (b.verdict.map(RANK) >= FAILED)
    ended = set(b[failed_b][RUN].itertuples(index=False, name=None))  # one row says it for all figures
    found: list[dict[str, Any]] = []
    for record in both.to_dict("records"):
        row = {str(name): value for name, value in record.items()}
        run = tuple(row[name] for name in RUN)
        if row["_merge"] == "left_only" and run in ended:
            continue
        if run in runs_b and (run in runs_a or RANK.get(row["verdict_b"], 0) >= FAILED):
            kind, why, reason = _kind(row, allowed)
            if kind:
                found.append(_shown(row) | {"kind": kind, "why": why, "reason": reason})
    for run in runs_b - runs_a:
        found.append(_one_sided(run, "new", ONE_SIDED))
    for run in runs_a - runs_b:
        others = [other for other in sorted(runs_b - runs_a) if _column(other)[:3] == run[:3]]
        same = [other for other in others if _column(other) == _column(run)]
        hint = "--match profile compares them" if same else "one run of both compares them"
        played = " and ".join(f"{profile} at {step_text(dt)} s" for *_, profile, dt, _, _ in same or others)
        reason = f"the later run has {played} ({hint})" if others else ONE_SIDED
        found.append(_one_sided(run, "gone", reasons.get(_column(run), reason)))
    frame = pd.DataFrame(found, columns=[*SHOWN, "why", "limit"])
    order = {kind: k for k, kind in enumerate(KINDS)}
    frame["order"] = [order[kind] for kind in frame.kind]
    frame["dt"] = frame.dt.astype(float)
    return frame.sort_values(["order", *KEY], kind="stable").drop(columns="order").reset_index(drop=True)


def _keyed(frame: pd.DataFrame, by_profile: bool) -> pd.DataFrame:
    """Rows of the runs that took place, with the columns that are compared."""
    names = [*KEY, "value", "unit", "low", "high", "limit", "verdict", "reason"]
    kept = frame.loc[~frame.verdict.isin(ABSENT), names].copy()
    kept["dt"] = kept.dt.fillna(0.0).round(12)
    if by_profile:
        runs = kept[RUN].drop_duplicates()
        runs = runs.assign(profile=runs.profile.map(_bare))
        if (twice := runs.duplicated([name for name in RUN if name != "dt"])).any():
            one = runs[twice].iloc[0]
            raise RunError(
                f"--match profile: a run has several columns of {one.scenario} on {one.engine} {one.profile}"
            )
        kept["profile"], kept["dt"] = kept.profile.map(_bare), 0.0
        ratios = kept.metric.str.startswith("ratio.")  # their subjects are columns
        kept.loc[ratios, "subject"] = kept.subject[ratios].map(_bare)
    return kept.drop_duplicates(KEY)


def _bare(label: str) -> str:
    return label.partition(", ")[0]


def _column(run: tuple[Any, ...]) -> tuple[Any, ...]:
    """Study, scene, engine and profile of a run."""
    return (*run[:3], _bare(run[3]))


def _one_sided(run: tuple[Any, ...], kind: str, reason: str) -> dict[str, Any]:
    fields = {"kind": kind, "metric": "run", "subject": "", "why": ROW, "reason": reason}
    return dict(zip(RUN, run)) | fields


def _shown(row: dict[str, Any]) -> dict[str, Any]:
    found = {name: row[name] for name in KEY} | {"limit": row["limit_b"]}
    found |= {"a": row["value_a"], "b": row["value_b"]}
    unit = row["unit_b"] if isinstance(row["unit_b"], str) else row["unit_a"]
    texts = {name: row[name] if isinstance(row[name], str) else "" for name in ("verdict_a", "verdict_b")}
    return found | {"unit": unit} | texts


def _kind(row: dict[str, Any], allowed: tuple[Tolerance, ...]) -> tuple[str, str, str]:
    """One of KINDS, what changed, and the reason; empty if nothing changed."""
    if row["_merge"] == "left_only":
        # The row of a run says why it failed.
        ran = row["metric"] == "run" and RANK.get(row["verdict_a"], 0) >= FAILED
        return ("better", ROW, f"no longer: {row['reason_a']}") if ran else ("gone", ROW, ONE_SIDED)
    if row["_merge"] == "right_only":
        failed = RANK.get(row["verdict_b"], 0) >= FAILED
        return ("worse", ROW, f"new: {row['reason_b']}") if failed else ("new", ROW, ONE_SIDED)
    before, after = RANK.get(row["verdict_a"], 0), RANK.get(row["verdict_b"], 0)
    if before != after:
        reason = row["reason_b"] if after > before else row["reason_a"]
        words = [row[name] or "no verdict" for name in ("verdict_a", "verdict_b")]
        kind = "worse" if after > before else "better"
        return kind, VERDICT, f"{' -> '.join(words)}: {reason}"
    a, b = row["value_a"], row["value_b"]
    if not (isfinite(a) and isfinite(b)):
        if isfinite(a) == isfinite(b):
            return "", "", ""
        if isfinite(a):
            return "worse", VALUE, f"not measured: {row['reason_b']}"
        return "better", VALUE, "measured again"
    tolerance = tolerance_of(allowed, row["metric"], row["engine"], row["scenario"])
    if tolerance.covers(a, b) or _overlap(row):
        return "", "", ""
    if row["verdict_b"] == "pass":
        return "changed", VALUE, "within its limit"
    worse = abs(b) - abs(a) if _has_better_side(row["metric"]) else 0.0
    kind = "worse" if worse > 0 else "better" if worse < 0 else "changed"
    return kind, VALUE, " ".join(("by", *quantity(row["metric"], b - a, row["unit_b"]))).strip()


def _overlap(row: dict[str, Any]) -> bool:
    """Whether both values have intervals that overlap; those of events are windows of expectation."""
    ends = [row[name] for name in ("low_a", "high_a", "low_b", "high_b")]
    if row["metric"].startswith("events.") or not all(isfinite(end) for end in ends):
        return False
    return bool(max(ends[0], ends[2]) <= min(ends[1], ends[3]))


def _has_better_side(metric: str) -> bool:
    """Whether a value nearer to 0 is better."""
    if metric in METRICS:
        return METRICS[metric].better == "lower"
    return metric.startswith("ratio.time") or metric.endswith(".spread")


WIDEST = 90
"""Widest remark of a report [characters]."""


def report(frame: pd.DataFrame) -> list[Part]:
    """Rows of `changes` by kind: scene, engine, metric, both values and the reason."""
    parts = []
    for kind, rows in frame.fillna({"unit": ""}).groupby("kind", sort=False):
        lines = [
            [
                row["scenario"],
                f"{row['engine']} {row['profile']}",
                f"{row['metric']} {row['subject'] or ''}".strip(),
                *("" if row[side] != row[side] else f"{row[side] * scale:.4g}" for side in "ab"),
                unit,
                str(row["reason"])[:WIDEST],
            ]
            for row in rows.to_dict("records")
            for unit, scale in [shown_unit(row["metric"], row["unit"])]
        ]
        heads = ("scene", "engine", "metric", "A", "B", "unit", "remark")
        parts.append(Part(f"{kind}: {len(rows)}", heads, lines, words=3, last=2))
    return parts
