"""The long table: every result of the project is one flat row."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from math import nan
from pathlib import Path

import pandas as pd

from touchstone.adapters.contract import MISSING, UNIMPORTABLE
from touchstone.reports.machine import machine, origin

UNJUDGED = "unjudged"
NOT_RUN = ("skipped", MISSING, UNIMPORTABLE)
"""Verdicts of runs that did not take place, and of metrics that do not apply."""
VERDICTS = ("", "pass", "fail", "known", "error", UNJUDGED, *NOT_RUN)
"""Blank: reported without a limit. `known`: a documented failing. `error`: the engine threw, hung or died.
`unjudged`: an oracle or a number to compare is missing. `missing`, `unimportable`: the engine is."""


CONSTRUCTION, UNAUDITED, UNAPPLIED = "construction", "unaudited", "ideal tracker"
HARNESS = "harness"
"""Basis of a known failing that our drive causes, not the engine: explicit torques, or our servo's gains."""
"""Basis of a verdict other than a measurement: a limit that the method meets by construction (angles are
clamped, overlap is removed last); impulses that the engine reports and no audit covers. The third explains a
missing verdict: the limit follows from the scene's ideal tracker."""


@dataclass(frozen=True, slots=True)
class Row:
    """One value [SI]. `subject` names a pair, body, stage or the other side of a ratio; `body_a` and `body_b`
    are the bodies of a pair, blank for other subjects; `low`, `high` bound an interval; `limit` is the limit
    behind `verdict`, `basis` the basis of the verdict; `dt` [s].

    `reason` is a sentence for readers; what another module needs of it is in `reason_code`, a word that the
    module that writes the row defines, and in `reproduce`, a command that shows the row again."""

    study: str
    scenario: str
    engine: str
    profile: str
    dt: float
    metric: str
    value: float = nan
    unit: str = ""
    subject: str = ""
    seed: int = 0
    repeat: int = 0
    low: float = nan
    high: float = nan
    limit: float = nan
    verdict: str = ""
    basis: str = ""
    reason: str = ""
    reason_code: str = ""
    reproduce: str = ""
    body_a: str = ""
    body_b: str = ""


COLUMNS = (
    *("study", "scenario", "engine", "profile", "dt", "seed", "repeat", "metric", "subject"),
    *("body_a", "body_b", "value", "unit", "low", "high", "limit"),
    *("verdict", "basis", "reason", "reason_code", "reproduce"),
)
NUMBERS = ("dt", "seed", "repeat", "value", "low", "high", "limit")
"""Columns of numbers; the others hold texts."""
assert set(COLUMNS) == {field.name for field in fields(Row)}


def is_undecided(row: Row, limit: float) -> bool:
    """Whether the interval of a ratio of times includes the limit: it gets no verdict."""
    within = row.low <= limit < row.value or row.value <= limit < row.high
    return row.metric.startswith(("ratio.time", "time.left")) and within


def table(rows: Iterable[Row]) -> pd.DataFrame:
    """Rows as a frame with the fixed columns."""
    return pd.DataFrame([asdict(row) for row in rows], columns=list(COLUMNS))


def rows_of(frame: pd.DataFrame) -> list[Row]:
    """The rows of a frame or of a part of it."""
    return [Row(**record) for record in frame.to_dict("records")]  # type: ignore[arg-type]


def by_scene(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Rows of each scene, in the order of the run."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row.scenario, []).append(row)
    return found


def write_beside(path: Path, write: Callable[[Path], object]) -> None:
    """Call `write` on a temporary file next to `path`, then rename it: `path` is complete or absent."""
    part = path.with_name(f"{path.name}.part")
    try:
        write(part)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text beside, then rename it."""
    write_beside(path, lambda part: part.write_text(text, "utf-8"))


def illustrate(path: Path, draw: Callable[[Path], object]) -> None:
    """Draw a picture or page of measurements that are saved: one that fails costs that file, and a line on
    standard error says why."""
    try:
        write_beside(path, draw)
    except Exception as error:
        reason = f"{error}".partition("\n")[0]
        line = f"touchstone: {path.name} is not written: {type(error).__name__}: {reason}"
        with suppress(OSError):  # standard error may be closed
            print(line, file=sys.stderr)


def save(frame: pd.DataFrame, folder: Path) -> None:
    """Write `results.parquet` and `results.csv`."""
    write_beside(folder / "results.parquet", lambda part: frame.to_parquet(part, index=False))
    write_beside(folder / "results.csv", lambda part: frame.to_csv(part, index=False))


def save_manifest(folder: Path, facts: Mapping[str, object]) -> None:
    """Write `manifest.json`: command, commit, day and machine, and the facts of the run."""
    text = json.dumps({**origin(), "machine": machine(), **facts}, indent=1)
    write_text(folder / "manifest.json", text)
