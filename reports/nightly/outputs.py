"""What a night leaves for people and for other programs: page, Markdown, JUnit XML, badge."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

import pandas as pd

from touchstone.reports.nightly.night import NightResults
from touchstone.reports.nightly.store import Night
from touchstone.reports.nightly.verdict import CHANGE, GONE, ORDER, REGRESSION, WARNING, Finding, ordered
from touchstone.reports.page import charts
from touchstone.reports.page.html import Change, Content
from touchstone.reports.page.page import page
from touchstone.reports.results import rows_of, write_beside
from touchstone.reports.runner.request import REFERENCE, STUDY, reproduce
from touchstone.reports.views.findings import published_part
from touchstone.reports.views.matrix import BAD, GOOD, WARN, verdict_of
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import exact_number
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.plural import plural

MOST_LINES = 20
"""Findings of a kind that Markdown lists; the rest is counted."""
FEW_NIGHTS = charts.LEAST_NIGHTS - 1
"""Nights of the table of times, which has the place of charts that would have as many points."""


def sentence(
    frame: pd.DataFrame, findings: Sequence[Finding], compared: bool, new_hardware: bool = False
) -> tuple[str, str]:
    """Level and verdict of a night in one sentence; a second one says that times have no history yet."""
    level, own = verdict_of(frame)
    counts = {kind: sum(one.kind == kind for one in findings) for kind in ORDER}
    if not compared:
        return level, f"First night of these settings, nothing to compare with. {own}"
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


def changes(findings: Sequence[Finding]) -> list[Change]:
    """The findings as the page shows them, the gravest first."""
    found = []
    for one in ordered(findings):
        moved, text = (said.replace("->", "→") for said in (one.moved, one.text))
        engine = f"{one.engine} {one.profile}".strip()
        found.append(Change(one.kind, one.scene, engine, one.metric, one.subject, moved, text))
    return found


def _own_times(history: pd.DataFrame) -> pd.DataFrame:
    """Times of each engine in its own profile."""
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
        ours, others = own[own.engine == REFERENCE], own[own.engine != REFERENCE]
        for name, series in (("reference", ours), ("engines", others)):
            if series.sequence.nunique() >= charts.LEAST_NIGHTS:
                drawn[f"{scene}, {name}"] = charts.nights(series, "median frame [µs]")
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
        changes=changes(findings),
        identity=[*known.items(), *facts["versions"].items(), *facts["machine"].items()],
        playback=measured.playback,
        settings=measured.settings,
        summaries={scene.name: scene.summary for scene in catalogue().values()},
        history=history[0],
        times=history[1],
    )
    _write(folder / "report.html", page(content))


def markdown(verdict: str, findings: Sequence[Finding], faults: Sequence[str]) -> str:
    """`report.md`: the verdict, the findings and faults of pages."""
    lines = [f"# {verdict}", ""]
    lines += [f"- {line.replace('<', '&lt;')}" for line in (*listed(findings), *faults)] or [
        "Nothing changed."
    ]
    return "\n".join(lines) + "\n"


def write_markdown(folder: Path, text: str) -> None:
    """Write `report.md`, and append it to the summary of a GitHub job where there is one."""
    _write(folder / "report.md", text)
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
            case = ElementTree.SubElement(
                suite, "testcase", classname=f"{scene}.{row.engine}.{row.profile}", name=name
            )
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
    suite = ElementTree.SubElement(
        suites, "testsuite", name="nights", tests=str(len(regressions)), failures=str(len(regressions))
    )
    for one in regressions:
        case = ElementTree.SubElement(suite, "testcase", classname="nights", name=one.place)
        ElementTree.SubElement(case, "failure", message=one.line)
    _write(folder / "junit.xml", ElementTree.tostring(suites, encoding="unicode", xml_declaration=True))


def write_badge(folder: Path, level: str) -> None:
    """Write `badge.json`, in the format of a shields.io endpoint."""
    word, color = {GOOD: ("passing", "brightgreen"), WARN: ("look", "yellow"), BAD: ("regression", "red")}[
        level
    ]
    badge = {"schemaVersion": 1, "label": "contact physics", "message": word, "color": color}
    _write(folder / "badge.json", json.dumps(badge))


def _write(path: Path, text: str) -> None:
    write_beside(path, lambda part: part.write_text(text, "utf-8"))
