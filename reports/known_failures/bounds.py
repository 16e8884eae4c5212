"""Upper bounds of documented failings; a failing beyond its bound counts as a new one.

`bounds.csv` holds a bound per engine, profile, scene, metric and subject: MARGIN times the measured value. In
a chaotic scene (`cause.Known`) one bound holds for all subjects: CHAOTIC_MARGIN times the largest value.
After engines or limits have changed, measure again by `touchstone run ... --profile ...` and

    python -m touchstone.reports.known_failures.measure runs/<time>/results.csv ...

which replaces the bounds of the failings in those runs, and removes those of failings that are no longer
documented.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from functools import cache
from math import ceil, floor, isfinite, log10
from pathlib import Path

from touchstone.reports.known_failures.cause import Known
from touchstone.reports.results import Row, write_beside

FILE = Path(__file__).with_suffix(".csv")
MARGIN = 1.25
"""Ratio of a bound to the measured value [1]: other processors and versions round differently."""
CHAOTIC_MARGIN = 10.0
"""The same in a chaotic scene [1]."""
ALL_SUBJECTS = "*"
"""Subject of the bounds of chaotic scenes."""
UNMEASURED: frozenset[tuple[str, str, str]] = frozenset()
"""Engine, profile and scene of runs that were not measured since their metrics changed. Until
they are, a failing there may lack a bound, or be gone."""
KEYS = ("engine", "profile", "scenario", "metric", "subject")
Key = tuple[str, ...]


def key_of(row: Row, known: Known | None = None) -> Key:
    """The key of a row's bound, as the documented failing `known`."""
    of_all = known is not None and known.chaotic and not known.subject
    subject = ALL_SUBJECTS if of_all else row.subject
    return (row.engine, row.profile, row.scenario, row.metric, subject)


def bound_of(row: Row, known: Known | None = None) -> float | None:
    """The largest size [SI] of a documented failing; None where none was measured."""
    return _bounds().get(key_of(row, known))


@cache
def _bounds() -> dict[Key, float]:
    return read(FILE)


def is_measured(row: Row) -> bool:
    """Whether the documented failings of a row's column and scene are all measured."""
    return (row.engine, row.profile, row.scenario) not in UNMEASURED


def was_failing(row: Row) -> bool:
    """Whether a row missed its limit when the documented failings were measured: an entry for a scene covers
    all its pairs, also those that meet the limit."""
    return is_measured(row) and (row.metric.startswith("events.") or bound_of(row) is not None)


def read(path: Path) -> dict[Key, float]:
    """The bounds of a file."""
    with open(path, newline="", encoding="utf-8") as file:
        return {tuple(row[key] for key in KEYS): float(row["largest"]) for row in csv.DictReader(file)}


def bounded(value: float, margin: float = MARGIN) -> float:
    """`margin` times the size of a value, rounded up to two digits."""
    size = abs(value) * margin
    step = 10.0 ** (floor(log10(size)) - 1)
    return float(f"{ceil(size / step) * step:.1e}")


def updated(
    old: dict[Key, float], rows: Iterable[tuple[Row, Known | None]], documented: Iterable[Key]
) -> dict[Key, float]:
    """Bounds after new measurements of documented failings: those of `documented` keys, newly measured or as
    before."""
    kept = set(documented)
    measured: dict[Key, float] = {}
    for row, known in rows:
        if isfinite(row.value) and row.value:
            key, chaotic = key_of(row, known), known is not None and known.chaotic
            bound = bounded(row.value, CHAOTIC_MARGIN if chaotic else MARGIN)
            measured[key] = max(bound, measured.get(key, 0.0))
    return {key: bound for key, bound in sorted((old | measured).items()) if key in kept}


def write(bounds: dict[Key, float], path: Path) -> None:
    """Write bounds, sorted."""

    def fill(part: Path) -> None:
        with open(part, "w", newline="", encoding="utf-8") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow((*KEYS, "largest"))
            table.writerows((*key, f"{bound:g}") for key, bound in sorted(bounds.items()))

    write_beside(path, fill)
