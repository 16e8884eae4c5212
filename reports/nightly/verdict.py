"""Verdict of a night: physics against the accepted night, times against the nights before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from touchstone.reports.nightly.due import OUTCOME, described
from touchstone.reports.nightly.identity import changes
from touchstone.reports.nightly.store import Night, Store
from touchstone.reports.nightly.timing_verdict import WINDOW, step, warns

KEYS = ["study", "scenario", "engine", "profile", "metric", "subject"]
SAME = 1e-2
"""Relative change of a physical figure that counts as none [1]: platforms repeat figures to rounding."""
FLOOR = 1e-9
"""Absolute change of a physical figure that counts as none [SI]: rounding over some hundred frames."""
TIMED = ("time.", "ratio.time")
"""Starts of the names of metrics that are times: no physics."""
SERIES = "time.frame.median"
NIGHTS = 2 * WINDOW
"""Nights whose times are read [1]."""
REGRESSION, WARNING, CHANGE, GONE = "regression", "warning", "change", "gone"


@dataclass(frozen=True, slots=True)
class Finding:
    """A difference of this night: kind, place (scene, engine, profile, metric), and one sentence."""

    kind: str
    place: str
    text: str

    @property
    def line(self) -> str:
        """The finding in one line."""
        return f"{self.kind}: {self.place}: {self.text}"


def physics(tonight: pd.DataFrame, accepted: pd.DataFrame) -> list[Finding]:
    """Findings of all figures but times: tonight's against those of the accepted night.

    A limit that broke, a known failing that grew, a run that failed and a figure no longer measured
    are regressions; other differences beyond SAME are changes.
    """
    ours, theirs = _figures(tonight), _figures(accepted)
    both = ours.join(theirs.add_suffix("_before"), how="outer")
    found = []
    for key, row in both.iterrows():
        finding = _compared(key, row)
        if finding:
            found.append(finding)
    return found


def _figures(frame: pd.DataFrame) -> pd.DataFrame:
    kept = frame[
        ~frame.metric.str.startswith(TIMED) & (frame.verdict != "skipped") & (frame.metric != "work")
    ]
    return kept.drop_duplicates(KEYS).set_index(KEYS)[["value", "limit", "verdict"]]


def _compared(key: Any, row: pd.Series) -> Finding | None:
    _, scene, engine, profile, metric, subject = key
    place = " ".join(filter(None, (scene, engine, profile, metric, subject)))
    now, before = row["verdict"], row["verdict_before"]
    if not isinstance(now, str):
        return Finding(REGRESSION, place, "no longer measured")
    if not isinstance(before, str):
        if now in ("fail", "error", "unjudged"):
            return Finding(REGRESSION, place, f"new, {now}")
        return None
    value, old = float(row["value"]), float(row["value_before"])
    moved = not np.isclose(value, old, rtol=SAME, atol=FLOOR, equal_nan=True)
    text = f"{described(metric, old)} -> {described(metric, value)}"
    if metric == OUTCOME and (now == "pass") != (before == "pass"):
        return Finding(GONE if now == "pass" else REGRESSION, place, text)
    if now in ("fail", "error", "unjudged") and before not in (now, "fail"):
        return Finding(REGRESSION, place, f"{before or 'no limit'} -> {now}, {text}")
    if before == "known" and now != "known":
        return Finding(GONE, place, f"a known failing is gone: {text}")
    if now == "known" and moved and abs(value) > abs(old):
        what = "a known failing grew" if before == "known" else "a known failing began"
        return Finding(REGRESSION, place, f"{what}: {text}")
    if before in ("fail", "error") and now not in ("fail", "error"):
        return Finding(GONE, place, f"{before} -> {now or 'no limit'}, {text}")
    return Finding(CHANGE, place, text) if moved else None


def compared_with(
    store: Store, nights: Sequence[Night], accepted: Night, scenes: pd.DataFrame
) -> pd.DataFrame:
    """Rows with which tonight's are compared: of the accepted night; of what it did not measure, such as a
    study that was not due, those of the last night before it that did, or else the first one after it.

    Args:
        nights: earlier nights, in order.
        scenes: study and scenario of what was measured tonight.
    """
    wanted = set(scenes[["study", "scenario"]].itertuples(index=False, name=None))
    found = []
    earlier = [night for night in nights if night.sequence < accepted.sequence]
    later = [night for night in nights if night.sequence > accepted.sequence]
    for night in (accepted, *reversed(earlier), *later):
        if not wanted:
            break
        rows = store.query([night], "select * from rows")
        keys = pd.MultiIndex.from_frame(rows[["study", "scenario"]])
        kept = rows[keys.isin(list(wanted))]
        wanted -= set(kept[["study", "scenario"]].itertuples(index=False, name=None))
        found.append(kept)
    return pd.concat(found, ignore_index=True)


def histories(store: Store, nights: Sequence[Night], fingerprint: str) -> pd.DataFrame:
    """Times of the last nights on one hardware: columns of KEYS, `sequence`, `value` [s]."""
    mine = [night for night in nights if night.identity.get("fingerprint") == fingerprint][-NIGHTS:]
    sql = (
        "select scenario, engine, profile, sequence, any_value(value) as value from rows "
        "where metric = ? and isfinite(value) group by all order by sequence"
    )
    found = store.query(mine, sql, [SERIES])
    return (
        found if len(found) else pd.DataFrame(columns=["scenario", "engine", "profile", "sequence", "value"])
    )


def timing(history: pd.DataFrame, nights: Mapping[int, Night], accepted: int = 0) -> list[Finding]:
    """Findings of times of the last night in `history`: a warning, or a confirmed step with its first night
    and what changed then. Steps up to the sequence number `accepted` are accepted."""
    found = []
    for (scene, engine, profile), series in history.groupby(["scenario", "engine", "profile"], sort=False):
        values = series.value.to_numpy(dtype=float)
        place = f"{scene} {engine} {profile} {SERIES}"
        confirmed = step(values)
        if confirmed is not None and int(series.sequence.iloc[confirmed.first]) <= accepted:
            # A new level was accepted: only the nights from it on count.
            values = values[confirmed.first :]
            confirmed = None
        if confirmed is not None:
            first = int(series.sequence.iloc[confirmed.first])
            text = f"{confirmed.ratio:.2f} times as long since {_when(nights, first)}: {_why(nights, first)}"
            found.append(Finding(REGRESSION, place, text))
        elif warns(values):
            found.append(Finding(WARNING, place, "2 of the last 3 nights are slower than before"))
    return found


def _when(nights: Mapping[int, Night], sequence: int) -> str:
    return str(nights[sequence].identity.get("started", "?"))[:10] if sequence in nights else "?"


def _why(nights: Mapping[int, Night], sequence: int) -> str:
    """What changed from the night before to the first bad one."""
    before = max((number for number in nights if number < sequence), default=None)
    if before is None or sequence not in nights:
        return "the night before is not stored"
    return (
        "; ".join(changes(nights[before].identity, nights[sequence].identity))
        or "nothing that is recorded changed"
    )
