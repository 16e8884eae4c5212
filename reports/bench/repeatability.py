"""Share of the intervals of two runs of `bench frame` that overlap.

python -m touchstone.reports.bench.repeatability runs/A/results.csv runs/B/results.csv
"""

from __future__ import annotations

import sys
from collections.abc import Iterable

import pandas as pd

from touchstone.reports.results import Row, rows_of

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
    return [
        row for path in paths for row in rows_of(pd.read_csv(path, keep_default_na=False, na_values=missing))
    ]


def main(paths: list[str]) -> None:
    """Print the share for ratios and for times; the paths are two equal halves."""
    half = len(paths) // 2
    found = overlaps(read(paths[:half]), read(paths[half:]))
    for prefix in PREFIXES:
        met = [meets for key, meets in found.items() if key[3].startswith(prefix)]
        if met:
            print(f"{prefix}: {sum(met)} of {len(met)} intervals overlap, {100 * sum(met) / len(met):.1f} %")


if __name__ == "__main__":
    main(sys.argv[1:])
