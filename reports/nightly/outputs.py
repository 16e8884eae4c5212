"""What a night leaves for people and for other programs: page, Markdown, JUnit XML, badge."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

import pandas as pd

from touchstone.reports.nightly.night import Measured
from touchstone.reports.nightly.store import Night
from touchstone.reports.nightly.verdict import CHANGE, GONE, REGRESSION, WARNING, Finding
from touchstone.reports.page import charts
from touchstone.reports.page.content import BAD, GOOD, WARN, Content, counted, verdict_of
from touchstone.reports.page.page import page
from touchstone.reports.results import rows_of, write_beside
from touchstone.reports.run.reproduce import reproduce
from touchstone.reports.run.request import REFERENCE, STUDY
from touchstone.scenarios.catalogue import catalogue

MOST_LINES = 20
"""Findings of a kind that are listed on the first screen; the rest is counted."""
ORDER = (REGRESSION, WARNING, GONE, CHANGE)


def sentence(frame: pd.DataFrame, findings: Sequence[Finding], compared: bool) -> tuple[str, str]:
    """Level and verdict of a night in one sentence."""
    level, own = verdict_of(frame)
    counts = {kind: sum(one.kind == kind for one in findings) for kind in ORDER}
    if not compared:
        return level, f"First night on this hardware, nothing to compare with. {own}"
    if counts[REGRESSION]:
        places = ", ".join(dict.fromkeys(one.place.split()[1] for one in findings if one.kind == REGRESSION))
        return BAD, f"{counted(counts[REGRESSION], 'confirmed regression')} ({places}). {own}"
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
        mine = [one.line for one in findings if one.kind == kind]
        lines += mine[:MOST_LINES]
        lines += [f"{kind}: {len(mine) - MOST_LINES} more"] if len(mine) > MOST_LINES else []
    return lines


def history_charts(history: pd.DataFrame, nights: Mapping[int, Night]) -> dict[str, str]:
    """One chart of times per scene over nights; the reference's times and those of the engines."""
    if history.sequence.nunique() < 2:
        return {}
    found = history.assign(
        night=pd.to_datetime([nights[int(k)].identity["started"] for k in history.sequence], utc=True),
        value=history.value * 1e6,
    )
    drawn = {}
    try:
        for scene, part in found.groupby("scenario", sort=False):
            own = part[part.profile.isin(["balanced", "recommended"])]
            ours, others = own[own.engine == REFERENCE], own[own.engine != REFERENCE]
            for name, series in (("reference", ours), ("engines", others)):
                if len(series):
                    drawn[f"{scene}, {name}"] = charts.nights(series, "", "median frame [µs]")
    except charts.ChartsMissing:
        return {}
    return drawn


def write_page(
    folder: Path,
    measured: Measured,
    level: str,
    verdict: str,
    findings: Sequence[Finding],
    drawn: Mapping[str, str],
) -> None:
    """Write `report.html`."""
    facts = measured.identity
    known = {"commit": f"{facts['commit']}{'+' if facts['dirty'] else ''}", "started": facts["started"]}
    known |= {"load": f"{facts['load']:.2f}", "hardware": facts["fingerprint"]}
    content = Content(
        title=f"touchstone, night of {str(facts['started'])[:10]}",
        level=level,
        verdict=verdict,
        frame=measured.frame[measured.frame.study == STUDY],
        studies=measured.frame[measured.frame.study != STUDY],
        command="touchstone nightly" + (" --quick" if facts["settings"].get("quick") else ""),
        changes=listed(findings),
        identity=[*known.items(), *facts["versions"].items(), *facts["machine"].items()],
        playback=measured.playback,
        settings=measured.settings,
        summaries={scene.name: scene.summary for scene in catalogue().values()},
        history=drawn,
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
        ElementTree.SubElement(case, "failure", message=one.text)
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
