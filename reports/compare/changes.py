"""What changed from one run to another, beyond intervals, limits and tolerances.

A row is worse if its verdict is, or if its value moved to the worse side by more than its tolerance while it
has no limit or breaks it. Within a limit nothing is worse. Where both values have intervals, they must be
apart. A value whose metric has no better side has changed. What the later run lacks is gone: a scene, an
engine, a figure, or a column of other settings or another step.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

import pandas as pd

from touchstone.adapters.contract import MISSING, UNIMPORTABLE
from touchstone.reports.compare.stored import RunError
from touchstone.reports.compare.tolerances import Tolerance, tolerance_of
from touchstone.reports.metrics import METRICS
from touchstone.reports.results import UNJUDGED
from touchstone.reports.run.request import step_text

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
"""How bad a verdict is."""
FAILED = RANK["fail"]
ONE_SIDED = "in one run only"
ABSENT = (MISSING, UNIMPORTABLE)
"""Verdicts of runs that did not take place."""
KINDS = ("worse", "gone", "changed", "better", "new")
FAILING = ("worse", "gone")
"""Kinds that count as failures."""
SHOWN = ["kind", *KEY, "a", "b", "unit", "verdict_a", "verdict_b", "reason"]


def changes(
    a: pd.DataFrame, b: pd.DataFrame, allowed: tuple[Tolerance, ...], by_profile: bool = False
) -> pd.DataFrame:
    """Rows that changed from table `a` to table `b`, with columns SHOWN; the worst kind first.

    Runs that only one of the tables has, such as other scenes, are one row each: new or gone. Figures of a
    new run that fail are worse.

    Args:
        by_profile: compare columns of one profile, whatever their settings and steps are.
    Raises:
        RunError: under `by_profile`, a table has several columns of one scene, engine and profile.
    """
    reasons = _absent(b)
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
            kind, reason = _kind(row, allowed)
            if kind:
                found.append(_shown(row, kind, reason))
    for run in runs_b - runs_a:
        found.append(_one_sided(run, "new", ONE_SIDED))
    for run in runs_a - runs_b:
        others = [other[3:5] for other in sorted(runs_b - runs_a) if _column(other) == _column(run)]
        played = " and ".join(f"{profile} at {step_text(dt)} s" for profile, dt in others)
        reason = f"the later run has {played} (--match profile compares them)" if others else ONE_SIDED
        found.append(_one_sided(run, "gone", reasons.get(_column(run), reason)))
    frame = pd.DataFrame(found, columns=SHOWN)
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
    """The profile of a label, without what was changed in it."""
    return label.partition(", ")[0]


def _column(run: tuple[Any, ...]) -> tuple[Any, ...]:
    """Study, scene, engine and profile of a run."""
    return (*run[:3], _bare(run[3]))


def _absent(frame: pd.DataFrame) -> dict[tuple[Any, ...], str]:
    """Why runs did not take place, by study, scene, engine and profile."""
    rows = frame[frame.verdict.isin(ABSENT)].to_dict("records")
    return {_column(tuple(row[name] for name in RUN)): f"{row['verdict']}: {row['reason']}" for row in rows}


def _one_sided(run: tuple[Any, ...], kind: str, reason: str) -> dict[str, Any]:
    return {**dict(zip(RUN, run)), "kind": kind, "metric": "run", "subject": "", "reason": reason}


def _shown(row: dict[str, Any], kind: str, reason: str) -> dict[str, Any]:
    found = {name: row[name] for name in KEY} | {"kind": kind, "reason": reason}
    found |= {"a": row["value_a"], "b": row["value_b"]}
    unit = row["unit_b"] if isinstance(row["unit_b"], str) else row["unit_a"]
    texts = {name: row[name] if isinstance(row[name], str) else "" for name in ("verdict_a", "verdict_b")}
    return found | {"unit": unit} | texts


def _kind(row: dict[str, Any], allowed: tuple[Tolerance, ...]) -> tuple[str, str]:
    """One of KINDS and why; empty if nothing changed."""
    if row["_merge"] == "left_only":
        # The row of a run says why it failed.
        ran = row["metric"] == "run" and RANK.get(row["verdict_a"], 0) >= FAILED
        return ("better", f"no longer: {row['reason_a']}") if ran else ("gone", ONE_SIDED)
    if row["_merge"] == "right_only":
        failed = RANK.get(row["verdict_b"], 0) >= FAILED
        return ("worse", f"new: {row['reason_b']}") if failed else ("new", ONE_SIDED)
    before, after = RANK.get(row["verdict_a"], 0), RANK.get(row["verdict_b"], 0)
    if before != after:
        reason = row["reason_b"] if after > before else row["reason_a"]
        words = [row[name] or "no verdict" for name in ("verdict_a", "verdict_b")]
        return ("worse" if after > before else "better"), f"{' -> '.join(words)}: {reason}"
    a, b = row["value_a"], row["value_b"]
    if not (isfinite(a) and isfinite(b)):
        if isfinite(a) == isfinite(b):
            return "", ""
        return ("worse", f"not measured: {row['reason_b']}") if isfinite(a) else ("better", "measured again")
    tolerance = tolerance_of(allowed, row["metric"], row["engine"], row["scenario"])
    if tolerance.covers(a, b) or _overlap(row):
        return "", ""
    if row["verdict_b"] == "pass":
        return "changed", "within its limit"
    sign = _sign(row["metric"])
    if not sign:
        return "changed", f"by {b - a:.3g}"
    return ("worse" if sign * (b - a) > 0 else "better"), f"by {b - a:.3g}"


def _overlap(row: dict[str, Any]) -> bool:
    """Whether both values have intervals that overlap; those of events are windows of expectation."""
    ends = [row[name] for name in ("low_a", "high_a", "low_b", "high_b")]
    if row["metric"].startswith("events.") or not all(isfinite(end) for end in ends):
        return False
    return bool(max(ends[0], ends[2]) <= min(ends[1], ends[3]))


def _sign(metric: str) -> int:
    """1 if lower is better, -1 if higher is, 0 if neither."""
    if metric in METRICS:
        return {"lower": 1, "higher": -1, "none": 0}[METRICS[metric].better]
    return 1 if metric.startswith("ratio.time") or metric.endswith(".spread") else 0
