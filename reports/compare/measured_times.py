"""Tolerances of times, measured: how far apart the times of runs of one program on one machine are.

`times.toml` has those that `touchstone compare` takes unless a file says otherwise. Measure it again by
several runs, `touchstone run SCENES --out runs/K`, and

    touchstone tolerances runs/1 runs/2 ... --out times.toml && mv times.toml reports
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from math import ceil, inf, isfinite

import pandas as pd

from touchstone.reports.changes import KEY, TIMED
from touchstone.reports.compare.stored import RunError
from touchstone.reports.machine import machine

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
    joined = _joined(tables)
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
    found["tolerance"] = [_tolerance(value) for value in found.largest]
    return found[list(HEADS)]


def _tolerance(largest: float) -> float:
    """MARGIN times the largest difference, rounded up; inf where that covers any difference."""
    found = ceil(round(100 * MARGIN * largest, 6)) / 100
    return found if found < 1 else inf


def _joined(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Values of the rows that all runs have, a column per run."""
    parts = []
    for name, frame in tables.items():
        kept = frame.drop_duplicates(KEY)
        kept = kept.assign(dt=kept.dt.fillna(0.0).round(12)).set_index(KEY)
        parts.append(kept.value.rename(name))
    return pd.concat(parts, axis=1, join="inner")


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
            f"[[tolerances]] # {row['rows']} rows: largest {row['largest']:.2f}, median {row['median']:.3f}",
        ]
        lines += [f'metric = "{row["metric"]}"', f"relative = {_number(row['tolerance'])}"]
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    return f"{value:g}" if isfinite(value) else "inf"
