"""Verdict of a night: physics against the accepted night, times against the nights before.

Verdicts on a series of times, one value per night: rules for noise that is right-tailed and has spikes.

A step is confirmed by an exact permutation test: how much better does one common shift explain the last three
nights than three draws from the noise, compared with every other choice of three nights? The noise model (a
normal core, and spikes with an exponential tail) decides the power only. The rate of false alarms is the
level of the test for any noise whose nights are exchangeable.

The page of a night, and its files for CI: JUnit, Markdown and a badge.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from math import inf, isnan, nan
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from touchstone.adapters.contract import Array
from touchstone.reports.changes import ACROSS_NIGHTS, ROW, TIMED, VERDICT, changes
from touchstone.reports.metrics import label
from touchstone.reports.nightly.night import OUTCOME, NightResults, described
from touchstone.reports.nightly.store import Night, Store, identity_changes
from touchstone.reports.page import charts
from touchstone.reports.page.html import Change, Content
from touchstone.reports.page.page import page
from touchstone.reports.results import COLUMNS, rows_of, write_text
from touchstone.reports.runner.request import REFERENCE, STUDY, reproduce
from touchstone.reports.views.findings import published_part
from touchstone.reports.views.matrix import BAD, GOOD, WARN, verdict_of
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import exact_number, quantity
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.plural import plural

FEWEST = 10
"""Nights before which there is no verdict [1]."""
WINDOW = 60
"""Nights before the last ones with which these are compared [1]."""
RECENT = 3
"""Last nights that are compared [1]."""
MADS = 4.0
"""Distance from the median that warns, in median absolute deviations [1]."""
SHARE = 0.05
"""Least relative distance from the median that warns or confirms [1]."""
LEVEL = 0.0075
"""Level of the test that confirms a step [1]: below the 1 % of false alarms that is allowed."""
NORMAL = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation [1]."""
QUIETEST = 1e-3
"""Least standard deviation of the logarithm of a time [1]: clocks and frequencies vary by as much."""
SPIKE = 3.0
"""Distance from the median from which a night counts as a spike [standard deviations]."""
TAIL = 8.0
"""Mean height of spikes [standard deviations]: 40 % where nights vary by 5 %."""
FEW_SPIKES, MANY_SPIKES = 0.01, 0.3
"""Bounds of the share of spikes in the model [1]."""
LEAST_DENSITY = 1e-4
"""Density that the model adds everywhere [1 / standard deviation], so that no night is impossible."""
LAG = 14
"""Last nights that are not among those before, once there are enough: a step shows for as long [1]."""


@dataclass(frozen=True, slots=True)
class Step:
    """A confirmed step: index of its first night, median before and after."""

    first: int
    before: float
    after: float

    @property
    def ratio(self) -> float:
        """Time after over time before [1]."""
        return self.after / self.before


def warns(values: Array) -> bool:
    """Whether 2 of the last 3 nights lie above median + max(4 MAD, 5 %) of those before."""
    before, last = _split(_finite(values))
    if len(before) < FEWEST:
        return False
    median = np.median(before)
    mad = np.median(np.abs(before - median))
    return int(np.sum(last > median + max(MADS * mad, SHARE * median))) >= 2


def step(values: Array) -> Step | None:
    """The step upwards that the last nights confirm, with its first night.

    Args:
        values: time of each night [s], in order; NaN where a night has none.
    """
    series = _finite(values)
    before, last = _split(series)
    if len(before) < FEWEST:
        return None
    middle = float(np.median(before))
    far = float(np.median(last)) > (1 + SHARE) * middle and last.min() > middle
    if not far or chance(before, last) > LEVEL:
        return None
    first = _first_night(series)
    kept = np.flatnonzero(_usable(np.asarray(values, dtype=float)))
    before, after = series[:first][-WINDOW:], series[first:]
    return Step(int(kept[first]), float(np.median(before)), float(np.median(after)))


def chance(before: Array, last: Array) -> float:
    """P-value of the permutation test: the share of all choices of RECENT nights whose likelihood ratio of a
    step is no less than that of `last` [1].

    Args:
        before, last: times [s], positive; `last` holds RECENT of them.
    """
    logs = np.log(np.r_[before, last])
    middle = np.median(logs)
    scale = max(NORMAL * float(np.median(np.abs(logs - middle))), QUIETEST)
    z = (logs - middle) / scale
    spikes = float(np.clip(np.mean(z > SPIKE), FEW_SPIKES, MANY_SPIKES))
    chosen = _choices(len(z))
    # the shift that explains three nights best is nearly their median
    shift = np.maximum(np.median(z[chosen], axis=1), np.log(1 + SHARE) / scale)
    ratio = (_log_density(z[chosen] - shift[:, None], spikes) - _log_density(z, spikes)[chosen]).sum(axis=1)
    # The last choice is that of the last nights; rounding must not break ties.
    return float(np.mean(ratio >= ratio[-1] - 1e-9))


@cache
def _choices(count: int) -> NDArray[np.intp]:
    """All choices of RECENT of `count` nights, the last nights last."""
    return np.array(list(combinations(range(count), RECENT)))


def _log_density(z: Array, spikes: float) -> Array:
    """Logarithm of the model's density at distances z from the median [standard deviations]."""
    core = np.exp(-z * z / 2) / np.sqrt(2 * np.pi)
    tail = np.where(z > 0, np.exp(-np.abs(z) / TAIL) / TAIL, 0.0)
    found: Array = np.log((1 - spikes) * core + spikes * tail + LEAST_DENSITY)
    return found


def _finite(values: Array) -> Array:
    found = np.asarray(values, dtype=float)
    return found[_usable(found)]


def _usable(values: Array) -> NDArray[np.bool_]:
    """Whether each night has a time."""
    return np.isfinite(values) & (values > 0)


def _split(series: Array) -> tuple[Array, Array]:
    """Nights before, and the last ones."""
    lag = LAG if len(series) >= FEWEST + LAG else RECENT
    return series[:-lag][-WINDOW:], series[-RECENT:]


def _first_night(series: Array) -> int:
    """The split in the last nights that leaves the least sum of absolute deviations from two medians."""
    part = series[-(WINDOW + LAG) :]
    cost = {
        k: np.abs(part[:k] - np.median(part[:k])).sum() + np.abs(part[k:] - np.median(part[k:])).sum()
        for k in range(max(1, len(part) - LAG), len(part) - RECENT + 1)
    }
    return len(series) - len(part) + min(cost, key=lambda k: cost[k])


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
            when = str(nights[first].identity.get("started", "?"))[:10] if first in nights else "?"
            text = f"{confirmed.ratio:.2f} times as long since {when}: {_why(nights, first)}"
            found.append(Finding(REGRESSION, *place, text, confirmed.before, confirmed.after))
        elif warns(values):
            before = float(np.nanmedian(values[:-RECENT]))
            text = "2 of the last 3 nights are slower than before"
            found.append(Finding(WARNING, *place, text, before, float(values[-1])))
    return found


def _why(nights: Mapping[int, Night], sequence: int) -> str:
    """What changed from the night before to the first bad one."""
    before = max((number for number in nights if number < sequence), default=None)
    if before is None or sequence not in nights:
        return "the night before is not stored"
    changed = identity_changes(nights[before].identity, nights[sequence].identity)
    return "; ".join(changed) or "nothing that is recorded changed"


MOST_LINES = 20
"""Findings of a kind that Markdown lists; the rest is counted."""
FEW_NIGHTS = charts.LEAST_NIGHTS - 1
"""Nights of the table of times, which has the place of charts that would have as many points."""


def sentence(
    frame: pd.DataFrame, findings: Sequence[Finding], before: pd.DataFrame | None, new_hardware: bool = False
) -> tuple[str, str]:
    """Level and verdict of a night in one sentence; others count the figures that `before`, the rows with
    which it is compared, has not judged, and say that times have no history yet."""
    level, own = verdict_of(frame)
    counts = {kind: sum(one.kind == kind for one in findings) for kind in ORDER}
    if before is None:
        return level, f"First night of these settings, nothing to compare with. {own}"
    judged, known = (set(one[one.verdict != ""][KEYS].itertuples(index=False)) for one in (frame, before))
    if new := len(judged - known):
        own += f" {plural(new, 'figure')} judged for the first time: hard cases and studies take turns."
    own += " First night on this hardware: its times have nothing to compare with." if new_hardware else ""
    if counts[REGRESSION]:
        places = ", ".join(dict.fromkeys(one.engine for one in findings if one.kind == REGRESSION))
        return BAD, f"{plural(counts[REGRESSION], 'confirmed regression')} ({places}). {own}"
    parts = [
        f"{counts[k]} {word}"
        for k, word in ((WARNING, "slower, unconfirmed"), (GONE, "gone"), (CHANGE, "changed"))
        if counts[k]
    ]
    if level == GOOD and (counts[WARNING] or counts[GONE]):
        level = WARN
    return level, f"No regression{': ' + ', '.join(parts) if parts else ''}. {own}"


def listed(findings: Sequence[Finding]) -> list[str]:
    """Lines of the findings, the gravest first, MOST_LINES of a kind."""
    lines = []
    for kind in ORDER:
        mine = [one.line for one in ordered(findings) if one.kind == kind]
        lines += mine[:MOST_LINES]
        lines += [f"{kind}: {len(mine) - MOST_LINES} more"] if len(mine) > MOST_LINES else []
    return lines


def shown_changes(findings: Sequence[Finding]) -> list[Change]:
    """The findings as the page shows them, the gravest first."""
    found = []
    for one in ordered(findings):
        moved, text = (said.replace("->", "→") for said in (one.moved, one.text))
        engine = f"{one.engine} {one.profile}".strip()
        found.append(Change(one.kind, one.scene, engine, one.metric, one.subject, moved, text))
    return found


def _own_times(history: pd.DataFrame) -> pd.DataFrame:
    return history[history.profile.isin(["balanced", "recommended"])]


def history_charts(history: pd.DataFrame, nights: Mapping[int, Night]) -> dict[str, str]:
    """One chart of times per scene over nights; the reference's times and those of the engines. None with
    fewer than LEAST_NIGHTS nights."""
    if history.sequence.nunique() < charts.LEAST_NIGHTS:
        return {}
    found = history.assign(
        night=pd.to_datetime([nights[int(k)].identity["started"] for k in history.sequence], utc=True),
        value=history.value * 1e6,
    )
    drawn = {}
    for scene, own in _own_times(found).groupby("scenario"):
        for name, mine in (("reference", own.engine == REFERENCE), ("engines", own.engine != REFERENCE)):
            if own[mine].sequence.nunique() >= charts.LEAST_NIGHTS:
                drawn[f"{scene}, {name}"] = charts.nights(own[mine], "median frame [µs]")
    return drawn


def history_table(history: pd.DataFrame, nights: Mapping[int, Night]) -> Part:
    """Times of nights that are too few for a chart, and the change of the last one."""
    numbers = sorted(set(history.sequence))
    if not 2 <= len(numbers) <= FEW_NIGHTS:
        return Part()
    dates = [str(nights[int(k)].identity["started"])[:16].replace("T", " ") for k in numbers]
    heads, lines = ["scene", "engine", *(f"{date} [µs]" for date in dates), "last over first"], []
    for (scene, engine), part in _own_times(history).groupby(["scenario", "engine"]):
        values = part.set_index("sequence").value.reindex(numbers)
        ratio = values.iloc[-1] / values.iloc[0]
        line = [exact_number(1e6 * value) for value in values]
        lines.append([str(scene), str(engine), *line, exact_number(ratio)])
    return Part("", heads, lines, words=2)


def write_page(
    folder: Path,
    measured: NightResults,
    level: str,
    verdict: str,
    findings: Sequence[Finding],
    history: tuple[Mapping[str, str], Part],
) -> None:
    """Write `report.html`; `history` has the charts and the table of times."""
    facts = measured.identity
    known = {"commit": f"{facts['commit']}{'+' if facts['dirty'] else ''}", "started": facts["started"]}
    known |= {"load": f"{facts['load']:.2f}", "hardware": facts["fingerprint"]}
    run = measured.frame[measured.frame.study == STUDY]
    scenes = [one for one in catalogue().values() if one.name in set(run.scenario)]
    content = Content(
        title=f"touchstone, night of {str(facts['started'])[:10]}",
        level=level,
        verdict=verdict,
        frame=run,
        published=published_part(run, scenes),
        studies=measured.frame[measured.frame.study != STUDY],
        command="touchstone nightly" + (" --quick" if facts["settings"].get("quick") else ""),
        changes=shown_changes(findings),
        identity=[*known.items(), *facts["versions"].items(), *facts["machine"].items()],
        playback=measured.playback,
        settings=measured.settings,
        summaries={scene.name: scene.summary for scene in catalogue().values()},
        history=history[0],
        times=history[1],
    )
    write_text(folder / "report.html", page(content))


def markdown(verdict: str, findings: Sequence[Finding], faults: Sequence[str]) -> str:
    """`report.md`: the verdict, the findings and faults of pages."""
    lines = [f"# {verdict}", ""]
    lines += [f"- {line.replace('<', '&lt;')}" for line in (*listed(findings), *faults)] or ["No findings."]
    return "\n".join(lines) + "\n"


def write_markdown(folder: Path, text: str) -> None:
    """Write `report.md`, and append it to the summary of a GitHub job where there is one."""
    write_text(folder / "report.md", text)
    summary = os.environ.get("GITHUB_STEP_SUMMARY")
    if summary:
        with open(summary, "a", encoding="utf-8") as file:
            file.write(text)


def write_junit(folder: Path, frame: pd.DataFrame, findings: Sequence[Finding]) -> None:
    """Write `junit.xml`: a case per row with a verdict, and one per regression against earlier nights."""
    suites = ElementTree.Element("testsuites", name="touchstone")
    judged = [row for row in rows_of(frame) if row.verdict]
    for scene in dict.fromkeys(row.scenario for row in judged):
        mine = [row for row in judged if row.scenario == scene]
        suite = ElementTree.SubElement(suites, "testsuite", name=scene, tests=str(len(mine)))
        for row in mine:
            name = f"{row.metric} {row.subject}".strip()
            where = f"{scene}.{row.engine}.{row.profile}"
            case = ElementTree.SubElement(suite, "testcase", classname=where, name=name)
            message = f"{row.value:g}, limit {row.limit:g}: {row.reason}"
            if row.verdict in ("fail", "error"):
                tag = "failure" if row.verdict == "fail" else "error"
                ElementTree.SubElement(case, tag, message=message).text = reproduce(row)
            elif row.verdict != "pass":
                ElementTree.SubElement(case, "skipped", message=f"{row.verdict}: {row.reason}")
        for tag in ("failure", "error", "skipped"):
            key = {"failure": "failures", "error": "errors", "skipped": "skipped"}[tag]
            suite.set(key, str(len(suite.findall(f"testcase/{tag}"))))
    regressions = [one for one in findings if one.kind == REGRESSION]
    count = str(len(regressions))
    suite = ElementTree.SubElement(suites, "testsuite", name="nights", tests=count, failures=count)
    for one in regressions:
        case = ElementTree.SubElement(suite, "testcase", classname="nights", name=one.place)
        ElementTree.SubElement(case, "failure", message=one.line)
    write_text(folder / "junit.xml", ElementTree.tostring(suites, encoding="unicode", xml_declaration=True))


def write_badge(folder: Path, level: str) -> None:
    """Write `badge.json`, in the format of a shields.io endpoint."""
    looks = {GOOD: ("passing", "brightgreen"), WARN: ("look", "yellow"), BAD: ("regression", "red")}
    word, color = looks[level]
    badge = {"schemaVersion": 1, "label": "contact physics", "message": word, "color": color}
    write_text(folder / "badge.json", json.dumps(badge))
