"""Verdict of a night: physics against the accepted night, times against the nights before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isnan, nan
from typing import Any

import numpy as np
import pandas as pd

from touchstone.reports.changes import ACROSS_NIGHTS, ROW, TIMED, VERDICT, changes
from touchstone.reports.metrics.labels import label
from touchstone.reports.nightly.due import OUTCOME, described
from touchstone.reports.nightly.identity import identity_changes
from touchstone.reports.nightly.store import Night, Store
from touchstone.reports.nightly.timing_verdict import RECENT, WINDOW, step, warns
from touchstone.reports.results import COLUMNS
from touchstone.reports.views.tables import quantity

KEYS = ["study", "scenario", "engine", "profile", "metric", "subject"]
COLUMN = ["scenario", "engine", "profile"]
SAME = 1e-2
"""Relative change of a physical figure that counts as none [1]: platforms repeat figures to rounding."""
FLOOR = 1e-9
"""Absolute change of a physical figure that counts as none [SI]: rounding over some hundred frames."""
SERIES = "time.frame.median"
NIGHTS = 2 * WINDOW
"""Nights whose times are read [1]."""
REGRESSION, WARNING, CHANGE, GONE = "regression", "warning", "change", "gone"
ORDER = (REGRESSION, WARNING, GONE, CHANGE)
"""Kinds of findings, the gravest first."""
FAILED, UNMET = "error", ("fail", "unjudged")
"""Verdict of a run that failed, and of figures that do not meet a limit."""


@dataclass(frozen=True, slots=True)
class Finding:
    """A difference of this night.

    Attributes:
        kind: REGRESSION, WARNING, CHANGE or GONE.
        text: what happened, in a few words; may be empty.
        before, after: value [unit]; NaN where there is none.
        unit: unit of metrics that are not in METRICS.
        limit: limit of tonight [unit].
    """

    kind: str
    scene: str
    engine: str
    profile: str
    metric: str
    subject: str
    text: str
    before: float = nan
    after: float = nan
    unit: str = ""
    limit: float = nan

    @property
    def place(self) -> str:
        """Scene, engine, profile, metric and subject."""
        return " ".join(filter(None, (self.scene, self.engine, self.profile, self.metric, self.subject)))

    @property
    def moved(self) -> str:
        """Value before and after, in the unit of tables."""
        if isnan(self.before) and isnan(self.after):
            return ""
        if self.metric == OUTCOME:
            return f"{described(self.before)} -> {described(self.after)}"
        (old, unit), (new, _) = (quantity(self.metric, v, self.unit) for v in (self.before, self.after))
        return f"{old} -> {new} {unit}".strip()

    @property
    def weight(self) -> float:
        """How grave it is among those of its kind: its value over the limit, or over the value before; 0 for
        what is no longer measured, which a failed run explains."""
        if isnan(self.after):
            return inf if self.text.endswith(FAILED) else 0.0
        if self.limit > 0:
            return abs(self.after) / self.limit
        if self.limit == 0:
            return inf
        small, large = sorted((abs(self.before), abs(self.after)))
        return large / small if small > 0 else inf if large > 0 else 1.0

    @property
    def line(self) -> str:
        """The finding in one line."""
        who = " ".join((self.scene, self.engine, self.profile))
        name = label(self.metric) + (f" ({self.metric})" if label(self.metric) != self.metric else "")
        what = ": ".join(filter(None, (f"{name} {self.subject}".strip(), self.moved, self.text)))
        return f"{self.kind}: {who}: {what}"


def physics(tonight: pd.DataFrame, accepted: pd.DataFrame) -> list[Finding]:
    """Findings of all figures but times: tonight's against those of the accepted night.

    A limit that broke, a known failing that grew, a run that failed and a figure no longer measured
    are regressions; other changes beyond the tolerances of nights are changes.
    """
    found = changes(_figures(accepted), _figures(tonight), ACROSS_NIGHTS)
    return [finding for row in found.to_dict("records") if (finding := _finding(row)) is not None]


def ordered(findings: Sequence[Finding]) -> list[Finding]:
    """The findings by kind, the gravest first."""
    return sorted(findings, key=lambda one: (ORDER.index(one.kind), -one.weight))


def _figures(frame: pd.DataFrame) -> pd.DataFrame:
    """Rows that are compared, whatever their steps and seeds."""
    timed = frame.metric.str.startswith(TIMED) | (frame.metric == "work")
    kept = frame[~timed & (frame.verdict != "skipped")].drop_duplicates(KEYS)
    # a store keeps some of the columns
    return kept.reindex(columns=list(COLUMNS)).assign(dt=0.0, seed=0, repeat=0)


def _finding(row: Mapping[Any, Any]) -> Finding | None:
    before, now, why = row["verdict_a"], row["verdict_b"], row["why"]
    kind, text = CHANGE, ""
    if why == ROW:
        if row["kind"] in ("new", "better"):
            return None
        kind, text = REGRESSION, "no longer measured" if row["kind"] == "gone" else f"new, {now}"
    elif row["metric"] == OUTCOME and (now == "pass") != (before == "pass"):
        kind = GONE if now == "pass" else REGRESSION
    elif now == "known" and (why == VERDICT or abs(row["b"]) > abs(row["a"])) and before not in UNMET:
        kind, text = REGRESSION, f"a known failing {'grew' if before == 'known' else 'began'}"
    elif why == VERDICT and row["kind"] == "worse":
        kind, text = REGRESSION, f"{before or 'no limit'} -> {now}"
    elif why == VERDICT:
        known = "a known failing is gone"
        kind, text = GONE, known if before == "known" else f"{before} -> {now or 'no limit'}"
    figures = row["a"], row["b"], row["unit"], row["limit"]
    place = (row["scenario"], row["engine"], row["profile"], row["metric"], row["subject"])
    return Finding(kind, *place, text, *figures)


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
        rows = store.rows([night])
        keys = pd.MultiIndex.from_frame(rows[["study", "scenario"]])
        kept = rows[keys.isin(list(wanted))]
        wanted -= set(kept[["study", "scenario"]].itertuples(index=False, name=None))
        found.append(kept)
    return pd.concat(found, ignore_index=True)


def histories(store: Store, nights: Sequence[Night], fingerprint: str) -> pd.DataFrame:
    """Times of the last nights on one hardware: columns of KEYS, `sequence`, `value` [s]."""
    mine = [night for night in nights if night.identity.get("fingerprint") == fingerprint][-NIGHTS:]
    rows = store.rows(mine, SERIES)
    kept = rows[np.isfinite(rows.value)].drop_duplicates([*COLUMN, "sequence"])
    return kept[[*COLUMN, "sequence", "value"]]


def timing(history: pd.DataFrame, nights: Mapping[int, Night], accepted: int = 0) -> list[Finding]:
    """Findings of times of the last night in `history`: a warning, or a confirmed step with its first night
    and what changed then. Steps up to the sequence number `accepted` are accepted."""
    found = []
    for (scene, engine, profile), series in history.groupby(COLUMN, sort=False):
        values = series.value.to_numpy(dtype=float)
        place = (str(scene), str(engine), str(profile), SERIES, "")
        confirmed = step(values)
        if confirmed is not None and int(series.sequence.iloc[confirmed.first]) <= accepted:
            # A new level was accepted: only the nights from it on count.
            values = values[confirmed.first :]
            confirmed = None
        if confirmed is not None:
            first = int(series.sequence.iloc[confirmed.first])
            text = f"{confirmed.ratio:.2f} times as long since {_when(nights, first)}: {_why(nights, first)}"
            found.append(Finding(REGRESSION, *place, text, confirmed.before, confirmed.after))
        elif warns(values):
            before = float(np.nanmedian(values[:-RECENT]))
            text = "2 of the last 3 nights are slower than before"
            found.append(Finding(WARNING, *place, text, before, float(values[-1])))
    return found


def _when(nights: Mapping[int, Night], sequence: int) -> str:
    return str(nights[sequence].identity.get("started", "?"))[:10] if sequence in nights else "?"


def _why(nights: Mapping[int, Night], sequence: int) -> str:
    """What changed from the night before to the first bad one."""
    before = max((number for number in nights if number < sequence), default=None)
    if before is None or sequence not in nights:
        return "the night before is not stored"
    return (
        "; ".join(identity_changes(nights[before].identity, nights[sequence].identity))
        or "nothing that is recorded changed"
    )
