"""The study `paper`: the experiments of Schmidl and Lin (2004) on the reference's profile `paper`.

Scenes are played in turn, several times in one process; a frame's time is the median over its plays. Counters
and poses repeat exactly. All effects are on: the paper has neither plans nor fat bounds, so collisions are
detected in every frame. Claims of the paper are judged on these series (`claims.py`).
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import altair as alt
import numpy as np
import pandas as pd
from rich.text import Text

from touchstone.adapters.contract import AdapterError, Engine, Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import ENGINES, load
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of
from touchstone.reports.studies.paper.claims import (
    CLAIMS,
    COLLISION,
    JOINTS,
    PAIRS,
    PASSES,
    REMOVAL,
    SCENES,
    TESTED,
    Scenes,
    Series,
    series_of,
)
from touchstone.reports.studies.study import failures, kept
from touchstone.reports.views.pictures import INK, axis, by, save
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import exact_number
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.effects import PLANNED

STUDY, ENGINE, PROFILE = "paper", "reference", "paper"
SETTINGS = Settings(PROFILE, ENGINES[ENGINE].profiles[PROFILE], effects=PLANNED)
COLUMN = (ENGINE, SETTINGS.label, SETTINGS.dt)
CLAIM, REPRODUCED, NOT_REPRODUCED = f"{STUDY}.claim", "reproduced", "not reproduced"


def steps(repeats: int) -> int:
    """Number of progress steps of a run: plays of scenes, one of each untimed."""
    return len(SCENES) * (1 + repeats)


def run(repeats: int, out: Path, progress: Progress, engine: Engine | None = None) -> pd.DataFrame:
    """Play, judge and store; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        scenes, failures = played(engine or load(ENGINE), repeats, progress)
        rows = [*failures, *rows_of_scenes(scenes), *rows_of_claims(scenes)]
        facts = {"study": STUDY, "scenes": list(scenes), "repeats": repeats}
        pictures = {f"paper.{kind}": partial(draw_of, scenes, kind) for kind in ("png", "svg")}
        return kept(rows, folder, facts, pictures)


def played(engine: Engine, repeats: int, progress: Progress) -> tuple[Scenes, list[Row]]:
    """Series of every scene, in the order of the mean frame; rows of those that failed."""
    chosen = {name: catalogue()[name] for name in SCENES}
    plays: dict[str, list[Recording]] = {name: [] for name in chosen}
    failures: dict[str, Row] = {}
    for turn in range(1 + repeats):
        for name, scenario in chosen.items():
            progress(f"play {turn} of {repeats}", 1)
            if name in failures:
                continue
            try:
                recording = record(engine, scenario, SETTINGS)
            except AdapterError as error:
                failures[name] = Row(STUDY, name, *COLUMN, "run", verdict="error", reason=str(error))
                continue
            if turn:
                plays[name].append(recording)
    found = [series_of(one, plays[name]) for name, one in chosen.items() if name not in failures]
    found.sort(key=lambda series: float(series.frame.mean()))
    return {series.scenario.name: series for series in found}, list(failures.values())


def rows_of_scenes(scenes: Scenes) -> list[Row]:
    """Times, shares and work of every scene; means of work over the frames that have any."""
    return [
        Row(STUDY, name, *COLUMN, f"{STUDY}.{metric}", value, unit, subject)
        for name, series in scenes.items()
        for metric, subject, unit, value in _figures(series)
    ]


def _figures(series: Series) -> list[tuple[str, str, str, float]]:
    frame = series.frame
    found = [
        ("frame", "mean", "s", float(frame.mean())),
        ("frame", "median", "s", float(np.median(frame))),
        ("frame", "p95", "s", float(np.percentile(frame, 95))),
        ("rate", "p95", "1/s", 1 / float(np.percentile(frame, 95))),
        *(("share", stage, "1", series.share(stage)) for stage in series.stages),
    ]
    for metric, counter in (("passes", PASSES), ("joints", JOINTS), ("pairs", PAIRS)):
        counts = series.counts[counter]
        found.append((metric, "mean", "1", float(counts[counts > 0].mean()) if counts.any() else 0.0))
        found.append((metric, "peak", "1", float(counts.max())))
    return found


def rows_of_claims(scenes: Scenes) -> list[Row]:
    """A row per claim: the deciding value with its bound, the outcome, and the evidence."""
    found = []
    for claim in CLAIMS:
        key = (STUDY, ", ".join(claim.scenes), *COLUMN, CLAIM)
        missing = [name for name in claim.scenes if name not in scenes]
        if missing:
            reason = f"not played: {', '.join(missing)}"
            found.append(Row(*key, subject=claim.name, verdict="skipped", reason=reason))
            continue
        value, bound, unit, evidence, why, _ = finding = claim.rule(scenes)
        holds = claim.holds(finding)
        code, why_not = (REPRODUCED, "") if holds else (NOT_REPRODUCED, f". Why: {why}")
        row = Row(*key, value, unit, claim.name, limit=bound, basis=claim.basis)
        found.append(replace(row, reason=evidence + why_not, reason_code=code))
    return found


HEADS = (
    *("scene", "mean\n[µs]", "median\n[µs]", "p95\n[µs]", "colli-\nsion", "IK,\nremoval"),
    *("CCD passes\nmean", "\npeak", "joints\nmean", "pairs\nmean", "\npeak", "frames/s\nat p95"),
)
NOTES = (
    "in the order of the mean frame; shares of all stages; removal: of overlap, with IK, without detection;",
    "means of passes, joints and pairs are per frame, over the frames that have any",
)
CLAIM_NOTE = "rests on: counts and poses repeat exactly, times do not; with the deciding value and its bound"
VERDICT_STYLES = {REPRODUCED: "", NOT_REPRODUCED: "yellow"}


def report(frame: pd.DataFrame) -> list[Part]:
    """A line per scene, every claim with its evidence, and scenes that failed."""
    values = {(row.scenario, row.metric, row.subject): row.value for row in rows_of(frame)}
    scenes = [
        [name, *_cells({key[1:]: value for key, value in values.items() if key[0] == name})]
        for name in dict.fromkeys(frame[frame.metric == "paper.rate"].scenario)
    ]
    claims: list[list[str | Text]] = []
    texts = {claim.name: claim for claim in CLAIMS}
    judged = rows_of(frame[frame.metric == CLAIM])
    for row in judged:
        claim, verdict = texts[row.subject], row.reason_code or row.verdict
        unit = "" if row.unit == "1" else f" {row.unit}"
        bound = f"{exact_number(row.value)} {claim.relation} {exact_number(row.limit)}{unit}"
        text = Text.assemble(claim.text, " ", (f"({claim.place})", "dim"))
        basis = Text.assemble(row.basis, "\n", (bound if row.reason_code else "", "dim"))
        claims += [[text, row.reason, basis, Text(verdict, style=VERDICT_STYLES.get(verdict, "dim"))], []]
    count = sum(row.reason_code == REPRODUCED for row in judged)
    heads, told = (
        ("claim", "measured", "rests on", "verdict"),
        f"{count} of {len(judged)} claims are reproduced",
    )
    return [
        Part("paper: cost of a frame on the reference's profile `paper`", HEADS, scenes, NOTES),
        Part("paper: what it claims", heads, claims, [CLAIM_NOTE], [told], words=0, last=4),
        failures(frame[frame.verdict == "error"]),
    ]


def _cells(mine: dict[tuple[str, str], float]) -> list[str]:
    def of(metric: str, subject: str) -> float:
        return mine[f"paper.{metric}", subject]

    return [
        *(exact_number(1e6 * of("frame", subject)) for subject in ("mean", "median", "p95")),
        *(f"{100 * of('share', stage):.0f} %" for stage in (COLLISION, REMOVAL)),
        *(f"{of('passes', 'mean'):.1f}", f"{of('passes', 'peak'):.0f}", f"{of('joints', 'mean'):.1f}"),
        *(f"{of('pairs', 'mean'):.1f}", f"{of('pairs', 'peak'):.0f}", f"{of('rate', 'p95'):,.0f}"),
    ]


LINE, WORK, SHADE = "#0072B2", "#D55E00", "#EBEBEB"
STAGES = {
    COLLISION: ("collision detection", "#0072B2", "white"),
    REMOVAL: ("overlap removal with IK", "#D55E00", "white"),
    "drive": ("tracking and attraction", "#E69F00", INK),
    "impulses": ("impulses", "#009E73", "white"),
    "integration": ("integration", "#C9C9C9", INK),
}
"""Label, colour (of Okabe and Ito, safe for colour-blind readers), and that of the number on it."""
LEAST_LABEL = 4.0
"""Least share that has room for its number [%]."""


class Panel(NamedTuple):
    """A scene, its title, the counter below it with its label, and names of the stretches of contact."""

    scene: str
    title: str
    counter: str
    label: str
    contacts: tuple[str, ...]


PANELS = (
    Panel("table_slide", "Figure 7: hand over a table", TESTED, "convex pairs\ntested",
          ("slides\nthere", "slides\nback", "ball")),
    Panel("two_arms", "Figure 8: two arms against a wall", PASSES, "CCD passes",
          ("push 1", "push 2", "push 3")),
)  # fmt: skip


def draw_of(scenes: Scenes, kind: str, _: pd.DataFrame, path: Path) -> None:
    """Draw the frame time over two scenes with contact shaded and the work below, and shares per scene."""
    curves = [_curves(scenes[panel.scene], panel) for panel in PANELS if panel.scene in scenes]
    save(alt.vconcat(alt.hconcat(*curves), _shares(scenes), spacing=24), path, kind=kind)


def _curves(series: Series, panel: Panel) -> Any:
    half = 0.5 / series.scenario.frame_rate
    spans = [(series.time[first] - half, series.time[end - 1] + half) for first, end in series.contacts]
    named = panel.contacts if len(spans) == len(panel.contacts) else [""] * len(spans)
    rows = [(*span, sum(span) / 2, name) for span, name in zip(spans, named)]
    shaded = alt.Chart(pd.DataFrame(rows, columns=["start", "end", "time", "name"]))
    bands = shaded.mark_rect(color=SHADE).encode(x="start:Q", x2="end:Q")
    names = shaded.mark_text(baseline="top", lineBreak="\n", color=INK)
    counts, whole = series.counts[panel.counter], (0, series.time[-1])
    base = alt.Chart(pd.DataFrame({"time": series.time, "frame": 1e6 * series.frame, "work": counts}))
    time = bands + base.mark_line(color=LINE, strokeWidth=1.1).encode(
        x=axis(alt.X, "time", None, whole, labels=False, grid=False),
        y=axis(alt.Y, "frame", "frame time [µs]", (0, 1.2e6 * series.frame.max())),
    )
    time += names.encode(x="time:Q", y=alt.value(2), text="name:N")
    edge = {"color": WORK, "strokeWidth": 1.1}
    work = bands + base.mark_area(interpolate="step", color=WORK, opacity=0.3, line=edge).encode(
        x=axis(alt.X, "time", "time in the scene [s]; shaded: contact", whole, grid=False, tickCount=8),
        y=alt.Y("work:Q", axis=alt.Axis(title=panel.label.split("\n"), tickCount=4, tickMinStep=1)),
    )
    time = time.properties(title=f"{panel.title} ({panel.scene})", width=340, height=170)
    return time & work.properties(width=340, height=80)


def _shares(scenes: Scenes) -> Any:
    rows = [
        (f"{name}  {1e6 * series.frame.mean():.0f} µs", STAGES[stage][0], 100 * series.share(stage), order)
        for name, series in scenes.items()
        for order, stage in enumerate(STAGES)
        if stage in series.stages
    ]
    table = pd.DataFrame(rows, columns=["scene", "stage", "share", "order"])
    table["text"] = table["share"].map("{:.0f}".format).where(table["share"] >= LEAST_LABEL, "")
    names, colors, inks = zip(*STAGES.values())
    table["ink"] = table.stage.map(dict(zip(names, inks)))
    x = axis(alt.X, "share", "share of the time of all frames [%]", (0, 100), grid=False).stack("zero")
    y = alt.Y("scene:N", sort=None, title=None, axis=alt.Axis(ticks=False, domain=False))
    base = alt.Chart(table).encode(x=x, y=y, order="order:Q")
    bars = base.mark_bar(stroke="white").encode(color=by(alt.Color, "stage", dict(zip(names, colors))))
    texts = base.mark_text().encode(
        x=x.bandPosition(0.5), text="text:N", color=alt.Color("ink:N", scale=None)
    )
    title = "Stages per scene, in the order of the mean frame (beside the names)"
    return (bars + texts).properties(title=title, width=600, height=alt.Step(20))
