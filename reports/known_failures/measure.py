"""Measure the bounds of documented failings from tables of results.

python -m touchstone.reports.known_failures.measure runs/TIME/results.csv
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator

import pandas as pd

from touchstone.reports.known_failures.bounds import FILE, Key, key_of, read, updated, write
from touchstone.reports.known_failures.cause import Known
from touchstone.reports.limits import at_own_step, known_of, limit_of
from touchstone.reports.results import Row, rows_of
from touchstone.scenarios.catalogue import catalogue


def failing_known(row: Row) -> bool:
    """Whether a row of a table is a documented failing that misses its limit, whatever its bound."""
    scene = catalogue().get(row.scenario)
    tags = scene.tags if scene else ()
    if known_of(row, tags) is None or not at_own_step(row) or row.metric.startswith("events."):
        return False
    limit = limit_of(row, tags)
    return limit is not None and abs(row.value) > limit.largest


def _rows(paths: Iterable[str]) -> Iterator[Row]:
    for path in paths:
        frame = pd.read_csv(path, keep_default_na=False, na_values={"value": "", "limit": "", "dt": ""})
        yield from rows_of(frame.astype({"value": float, "limit": float, "dt": float}))


def main(paths: list[str]) -> None:
    """Update the bounds of documented failings from tables of results."""
    old = read(FILE) if FILE.exists() else {}
    failing = [(row, _known(row)) for row in _rows(paths) if failing_known(row)]
    documented = [key_of(row, known) for row, known in failing]
    now = updated(old, failing, [*documented, *(key for key in old if _documented(key))])
    write(now, FILE)
    print(f"{len(now)} bounds, {len(failing)} of them measured now")


def _known(row: Row) -> Known | None:
    scene = catalogue().get(row.scenario)
    return known_of(row, scene.tags if scene else ())


def _documented(key: Key) -> bool:
    engine, profile, scenario, metric, subject = key
    row = Row("run", scenario, engine, profile, 0.0, metric, subject=subject)
    known = _known(row)
    return known is not None and key_of(row, known)[-1] == subject


if __name__ == "__main__":
    main(sys.argv[1:])
