"""Limits on ratios of frame times: what is aimed at, and 1.5 times what `bench frame` or a run measured.

`time_limits.csv` holds the measured ratio of the reference to the fastest engine per scene, profile, kind of
comparison and metric. Measure again by `touchstone bench frame` and

    python -m touchstone.reports.run.time_limits runs/<folder>/results.csv ...
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from math import inf
from pathlib import Path

import pandas as pd

from touchstone.reports.results import Row, is_undecided, rows_of, write_beside
from touchstone.reports.runner.request import EQUAL_PROFILE, MACHINE_PROFILE, REFERENCE

OWN, EQUAL, POSED = "own steps", "equal steps", "posed"
"""Kinds of comparison: each engine at its recommended step; all at one step; engines with kinematic links."""
POSED_LABEL = "drive=posed"
"""Part of the label of a column whose links are kinematic."""
TARGETS: Mapping[tuple[str, str, str], float] = {
    ("gallery", OWN, "ratio.time"): 0.15,
    ("gallery", OWN, "ratio.time.p99"): 0.3,
    ("gallery", POSED, "ratio.time"): 0.5,
    ("gallery", EQUAL, "ratio.time"): 0.5,
    ("heap", EQUAL, "ratio.time"): 0.5,
    ("slide", EQUAL, "ratio.time"): 0.5,
    ("stack", EQUAL, "ratio.time"): 0.5,
    ("heap", OWN, "ratio.time"): 0.5,
    ("slide", OWN, "ratio.time"): 0.5,
    ("stack", OWN, "ratio.time"): 0.5,
    ("probe", OWN, "ratio.time"): 1.0,
    ("", OWN, "ratio.time"): 0.5,
}
"""Scene, tag or "" (others), kind and metric -> the largest ratio that `balanced` aims at."""
AIMING = ("balanced", "equal-step")
"""Profiles of the reference that TARGETS hold for; `equal-step` is `balanced` at the common step."""
MARGIN = 1.5
"""Largest ratio of a limit to the measured value [1], so that a slowdown shows."""
CLOSE = 1.25
"""Factor around a limit within which one run decides nothing [1]: runs differ by about 10 %."""
LEAST_FRAMES = 10
"""Least number of frames whose times one run may judge [1]: an impact of a probe lasts one."""
FILE = Path(__file__).with_suffix(".csv")
KEYS = ("scenario", "profile", "kind", "metric")
Key = tuple[str, str, str, str]


def kind_of(profile: str, label: str) -> str:
    """Kind of comparison of the reference's profile with an engine's column at own steps; "" for others."""
    posed, theirs = POSED_LABEL in label, label.partition(",")[0]
    if EQUAL_PROFILE in (profile, theirs):
        return EQUAL if profile == label else ""
    if theirs != MACHINE_PROFILE:
        return ""
    return POSED if posed else OWN


def judged_time(
    kind: str, row: Row, tags: tuple[str, ...], stages: str, frames: float = inf, median: float = inf
) -> Row:
    """The row with its limit and verdict: `known` where it misses its target and no limit on its growth.

    Args:
        stages: where the reference's time goes, for a target that is missed.
        frames: number of frames of a single run; inf: several restarts. A single run gets no verdict within
            CLOSE of the limit, on fewer than LEAST_FRAMES, or on a 99th percentile, which the machine's
            interruptions decide.
        median: low end of the interval of the ratio of the medians. A single run whose mean alone is beyond
            the limit gets no verdict: one interruption of some milliseconds doubles a mean.

    A limit is met or broken only where the whole interval of the ratio is on one side of it.
    """
    measured = _measured().get((row.scenario, row.profile, kind, row.metric))
    places = ((place, kind, row.metric) for place in (row.scenario, *tags, "") if row.profile in AIMING)
    target = next((TARGETS[place] for place in places if place in TARGETS), None)
    missed = target is not None and measured is not None and measured > target
    # single runs differ by more than MARGIN: where the target is met, it alone judges them
    if measured is None or (frames < inf and not missed):
        limit = target
    else:
        limit = MARGIN * measured if missed or target is None else min(target, MARGIN * measured)
    if limit is None:
        return row
    said = f"{kind}, against the fastest; {row.reason}"
    close = limit / CLOSE < row.value < limit * CLOSE
    few = frames < LEAST_FRAMES or row.metric.endswith(".p99") or median <= limit < row.value
    if frames < inf and (close or few):
        command = f"touchstone bench frame {row.scenario}"
        why = f"too close to {limit:.2g} for one run" if close else "no verdict from one run"
        return replace(row, reason=f"{said}: {why}, {command} decides")
    if is_undecided(row, limit):
        said += f": no verdict, its interval includes {limit:.2g}; more restarts decide"
        return replace(row, reason=said)
    verdict = "pass" if row.value <= limit else "fail"
    if target is not None and verdict == "pass" and row.value > target:
        verdict, said = "known", f"{said}; misses its target {target:g}; {stages}"
    return replace(row, limit=limit, verdict=verdict, reason=said)


@cache
def _measured() -> dict[Key, float]:
    return read(FILE)


def read(path: Path) -> dict[Key, float]:
    """The measured ratios of a file."""
    found = pd.read_csv(path, keep_default_na=False).set_index(list(KEYS)).ratio
    return {key: float(ratio) for key, ratio in found.items()}  # type: ignore[misc]


def write(measured: Mapping[Key, float], path: Path) -> None:
    """Write measured ratios, sorted."""
    rows = [(*key, f"{ratio:.3g}") for key, ratio in sorted(measured.items())]
    frame = pd.DataFrame(rows, columns=[*KEYS, "ratio"])
    write_beside(path, lambda part: frame.to_csv(part, index=False, lineterminator="\n"))


def measured_of(rows: Iterable[Row]) -> dict[Key, float]:
    """The largest ratio per key: to the fastest engine, in the slowest of several runs."""
    found: dict[Key, float] = {}
    for row in rows:
        kind = kind_of(row.profile, row.subject.partition(" ")[2])
        if row.metric.startswith("ratio.time") and row.engine == REFERENCE and kind:
            key = (row.scenario, row.profile, kind, row.metric)
            found[key] = max(found.get(key, 0.0), row.value)
    return found


def main(paths: list[str]) -> None:
    """Take the measured ratios from tables of results of `bench frame`."""
    now = read(FILE) if FILE.exists() else {}
    tables = (pd.read_csv(path, keep_default_na=False, na_values={"value": ""}) for path in paths)
    now |= measured_of(row for table in tables for row in rows_of(table))
    write(now, FILE)
    print(f"{len(now)} ratios")


if __name__ == "__main__":
    main(sys.argv[1:])
