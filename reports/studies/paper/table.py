"""The tables of the study `paper` on a terminal."""

from __future__ import annotations

import pandas as pd
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table
from rich.text import Text

from touchstone.reports.results import rows_of
from touchstone.reports.studies.paper.claim import CLAIMS
from touchstone.reports.studies.paper.series import COLLISION, REMOVAL
from touchstone.reports.studies.paper.study import CLAIM, NOT_REPRODUCED, REPRODUCED
from touchstone.reports.views.tables import exact_number
from touchstone.reports.views.terminal import print_notes, table_of

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


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print a line per scene, every claim with its evidence, and scenes that failed."""
    scenes = table_of(
        "paper: cost of a frame on the reference's profile `paper`", HEADS, padding=(0, 1, 0, 0)
    )
    values = {(row.scenario, row.metric, row.subject): row.value for row in rows_of(frame)}
    for name in dict.fromkeys(frame[frame.metric == "paper.rate"].scenario):
        scenes.add_row(name, *_cells({key[1:]: value for key, value in values.items() if key[0] == name}))
    out.print(scenes)
    print_notes(NOTES, out)
    claims = Table(title="paper: what it claims", title_justify="left", box=SIMPLE, pad_edge=False, leading=1)
    for head, width in (("claim", 32), ("measured", None), ("rests on", 13), ("verdict", 14)):
        claims.add_column(head, width=width)
    texts = {claim.name: claim for claim in CLAIMS}
    judged = rows_of(frame[frame.metric == CLAIM])
    for row in judged:
        claim, verdict = texts[row.subject], row.reason_code or row.verdict
        unit = "" if row.unit == "1" else f" {row.unit}"
        bound = f"{exact_number(row.value)} {claim.relation} {exact_number(row.limit)}{unit}"
        claims.add_row(
            Text.assemble(claim.text, " ", (f"({claim.place})", "dim")),
            Text(row.reason),
            Text.assemble(row.basis, "\n", (bound if row.reason_code else "", "dim")),
            Text(verdict, style=VERDICT_STYLES.get(verdict, "dim")),
        )
    out.print(claims)
    print_notes([CLAIM_NOTE], out)
    count = sum(row.reason_code == REPRODUCED for row in judged)
    out.print(f"{count} of {len(judged)} claims are reproduced", highlight=False)
    for failed in rows_of(frame[frame.verdict == "error"]):
        out.print(f"error: {failed.scenario}: {failed.reason}", highlight=False, style="red")


def _cells(mine: dict[tuple[str, str], float]) -> list[str]:
    def of(metric: str, subject: str) -> float:
        return mine[f"paper.{metric}", subject]

    return [
        *(exact_number(1e6 * of("frame", subject)) for subject in ("mean", "median", "p95")),
        *(f"{100 * of('share', stage):.0f} %" for stage in (COLLISION, REMOVAL)),
        *(f"{of('passes', 'mean'):.1f}", f"{of('passes', 'peak'):.0f}", f"{of('joints', 'mean'):.1f}"),
        *(f"{of('pairs', 'mean'):.1f}", f"{of('pairs', 'peak'):.0f}", f"{of('rate', 'p95'):,.0f}"),
    ]
