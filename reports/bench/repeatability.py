"""Share of the intervals of two runs of `bench frame` that overlap, and runs that are stored for it.

python -m touchstone.reports.bench.repeatability runs/A/results.csv runs/B/results.csv
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from re import sub
from typing import Any

import pandas as pd

from touchstone.reports.results import COLUMNS, Row, rows_of, table, write_beside

PREFIXES = ("time.frame", "ratio.time")
Key = tuple[str, str, str, str, str]


def overlaps(one: Iterable[Row], two: Iterable[Row]) -> dict[Key, bool]:
    """Whether the intervals of the rows that both have overlap, by what identifies a row."""
    first, second = _intervals(one), _intervals(two)
    return {
        key: first[key].low <= second[key].high and second[key].low <= first[key].high
        for key in first
        if key in second
    }


def _intervals(rows: Iterable[Row]) -> dict[Key, Row]:
    return {
        (row.scenario, row.engine, row.profile, row.metric, row.subject): row
        for row in rows
        if row.metric.startswith(PREFIXES) and row.low == row.low
    }


def read(paths: Iterable[str]) -> list[Row]:
    """The rows of tables of results."""
    missing = {"value": "", "low": "", "high": ""}
    frames = [pd.read_csv(path, keep_default_na=False, na_values=missing) for path in paths]
    return [row for frame in frames for row in rows_of(frame.reindex(columns=COLUMNS))]


def store(rows: pd.DataFrame, facts: Mapping[str, Any], folder: Path) -> None:
    """Keep the intervals of a run, `DAY-COMMIT.csv`, with its processor."""
    processor = facts.get("machine", {}).get("processor", "")
    kept = table(_intervals(rows_of(rows)).values()).assign(processor=processor)
    folder.mkdir(exist_ok=True)
    name = "-".join(sub("[^0-9a-z-]", "", str(facts.get(key, ""))[:12]) for key in ("day", "commit"))
    path = folder / f"{name}.csv"
    write_beside(path, lambda part: kept.to_csv(part, index=False))


def stored_lines(folder: Path) -> list[str]:
    """What the last stored run shares with the last one of an earlier day; which is missing, if it is."""
    paths = sorted(folder.glob("*.csv"))
    earlier = [path for path in paths if path.name[:10] < paths[-1].name[:10]]
    if not earlier:
        return [f"One run is stored ({paths[-1].stem}); none of an earlier day."]
    pair = (earlier[-1], paths[-1])
    processors = dict.fromkeys(str(pd.read_csv(path).processor.iloc[0]) for path in pair)
    names = f"{pair[0].stem} and {pair[1].stem}, {' and '.join(processors)}"
    return [f"{names}:", *(f"- {line}" for line in shared([str(path) for path in pair]))]


def shared(paths: list[str]) -> list[str]:
    """The share for ratios and for times; the paths are two equal halves."""
    half = len(paths) // 2
    found = overlaps(read(paths[:half]), read(paths[half:]))
    lines = []
    for prefix in PREFIXES:
        met = [meets for key, meets in found.items() if key[3].startswith(prefix)]
        if met:
            share = 100 * sum(met) / len(met)
            lines.append(f"{prefix}: {sum(met)} of {len(met)} intervals overlap, {share:.1f} %")
    return lines


def main(paths: list[str]) -> None:
    """Print `shared`."""
    print("\n".join(shared(paths)))


if __name__ == "__main__":
    main(sys.argv[1:])
