"""`touchstone run`: whole folders, output for machines, settings and commands that are told."""

import csv
import io
import json
from functools import partial
from pathlib import Path

import pandas as pd
import pytest

from touchstone.reports.metrics import METRICS
from touchstone.reports.results import COLUMNS, Row
from touchstone.reports.run import study
from touchstone.reports.runner import request
from touchstone.reports.studies import calibration
from touchstone.reports.verdict.rows import NEEDED, measured
from touchstone.scenarios.catalogue import catalogue

RUN = "run ball_snip --engine reference --profile balanced"


def test_a_run_writes_a_whole_folder(touchstone, handed_over, tmp_path, left):
    """A run leaves table, CSV, manifest, report, recordings and outputs, and nothing beside them."""
    code, out, err = touchstone(f"{RUN} --out here/results")
    assert code == 0
    assert left(tmp_path) == ["here"]
    assert left("here") == ["results"]
    tables = ("report.html", "report.md", "results.csv", "results.parquet")
    wanted = ["forces.png", "frame_budget.png", "manifest.json", "output", "recordings", *tables]
    assert left("here/results") == wanted
    assert left("here/results/recordings") == ["ball_snip-reference-balanced.npz"]
    assert "results: here/results" in out
    assert "overlap.max" in out
    assert err.splitlines()[0] == "scene 1 of 1: ball_snip"
    manifest = json.loads(Path("here/results/manifest.json").read_text())
    assert manifest["command"] == f"touchstone {RUN} --out here/results"
    assert manifest["engines"]["ball_snip/reference/balanced"]["engine"] == "reference"
    report = Path("here/results/report.md").read_text()
    results = pd.read_csv("here/results/results.csv")
    # metrics in the order of their table, each where it applies; two have tables of their own, one is a hash
    applies = set(results[results.value.notna()].metric) - {"work", "time.share", "run", "state.hash"}
    assert len(applies) > 20
    assert all((f"`{name}`" in report) == (name in applies) for name in METRICS)


@pytest.mark.parametrize("form", ["json", "csv"])
def test_machine_output_parses_and_stands_alone(touchstone, quick, form):
    """Standard output is the table and nothing else, columns in order, with every digit of the file's."""
    code, out, _ = touchstone(f"{RUN} --out r --format {form}")
    assert code == 0
    rows = json.loads(out) if form == "json" else list(csv.DictReader(io.StringIO(out)))
    assert all(tuple(row) == COLUMNS for row in rows)
    kept = pd.read_parquet("r/results.parquet")
    assert [row["metric"] for row in rows] == kept.metric.tolist()
    assert {row["metric"] for row in rows} >= set(METRICS)
    for row, value in zip(rows, kept.value):
        if value == value:
            # JSON shows 15 decimals: a femtometre
            assert float(row["value"]) == pytest.approx(value, rel=1e-12, abs=1e-15)
        else:
            assert row["value"] in (None, "")


def test_a_study_is_printed_for_machines(touchstone, monkeypatch):
    """Print the long table of `study calibration` as CSV and nothing else, and end well."""
    tiny = {"restitutions": (0.5,), "speeds": (2.0,), "frictions": (0.3,), "ladder": (), "steps": ()}
    requested = partial(calibration.Requested, pairs=("sphere-box",), **tiny)
    monkeypatch.setattr(calibration, "Requested", requested)
    code, out, err = touchstone(
        "study calibration --engine reference --profile balanced --format csv --out r --quiet"
    )
    assert (code, err) == (0, "")
    frame = pd.read_csv(io.StringIO(out))
    achieved = frame[frame.metric == "restitution.achieved"]
    assert achieved.value.tolist() == pytest.approx([0.5], abs=1e-4)
    assert achieved.reason.tolist() == ["asked 0.5"]


def test_what_is_not_asked_is_not_measured(registry):
    """Measure what is named and what that is judged by; the values are those of a whole run."""
    scenario, recording = catalogue()["ball_snip"], registry.played("ball_snip", "reference")
    base = Row("run", "ball_snip", "reference", "balanced", 1 / 60, "run")
    some = measured(base, scenario, recording, ("events.roll.spread", "friction.cone"))
    assert {row.metric for row in some} == {"events.roll", "friction.cone", *NEEDED}
    every = measured(base, scenario, recording)
    assert {row.metric for row in every} == set(METRICS)
    assert set(map(repr, some)) <= set(map(repr, every))


@pytest.mark.parametrize(
    ("asked", "line"),
    [
        ("friction.stop", "no body slides until it stops"),
        ("ratio.time", "it compares columns; name another engine or profile"),
        ("'f*'", "nothing in it that they measure"),
    ],
)
def test_a_metric_that_a_scene_lacks_is_named(touchstone, quick, asked, line):
    """Exit 2, no table, and a line with the reason and the metrics that have figures; rows are stored."""
    code, out, err = touchstone(f"run fall --engine reference --profile balanced --metric {asked} --out r")
    assert (code, out) == (2, "")
    said = err.splitlines()[-1]
    assert said.startswith(
        f"touchstone: --metric {asked.strip(chr(39))}: no figure in fall: {line} (valid here: "
    )
    assert "energy.*, overlap.time, solver.*" in said
    assert Path("r/results.csv").exists()
    code, out, _ = touchstone("judge r --metric friction.stop --metric overlap.time --out again")
    assert (code, "overlap.time" in out) == (0, True)
    code, _, err = touchstone("judge r --metric friction.stop --out third")
    assert (
        code,
        err.splitlines()[-1].startswith("touchstone: --metric friction.stop: no figure in fall: "),
    ) == (
        2,
        True,
    )
    code, _, err = touchstone("compare again again --metric energy.gain")
    said = "touchstone: --metric energy.gain: in neither run (valid here: friction.stop, overlap.time)\n"
    assert (code, err) == (2, said)


def test_changed_settings_are_told_everywhere(touchstone, tmp_path, left):
    """File results under profile and changes, in rows, table, recordings, report and manifest."""
    changed = "--profile balanced --set event_rows=100.0 --set removal=eq1 --set depth=exact"
    code, out, _ = touchstone(f"run fall --engine reference --out r --metric overlap.time {changed}")
    label = "balanced, depth=exact, event_rows=100"
    assert code == 0
    assert "depth=exact" in out
    assert set(pd.read_csv("r/results.csv").profile) == {label}
    assert left("r/recordings") == ["fall-reference-balanced+depth=exact+event_rows=100.npz"]
    reported = json.loads(Path("r/manifest.json").read_text())["engines"][f"fall/reference/{label}"]
    assert reported["profile"] == label
    assert (reported["settings"]["depth"], reported["settings"]["event_rows"]) == ("exact", 100)
    assert label in Path("r/report.md").read_text()


def test_differences_are_shown_again_by_their_commands(touchstone, registry, tmp_path, left):
    """Tell two engines apart in the page and a picture, and get the same value from the command it names."""
    registry.engine("mujoco")
    asked = "--engine reference --engine mujoco --profile balanced --profile recommended"
    assert touchstone(f"run fall {asked} --metric energy.loss --out r --quiet")[0] == 0
    assert "energy.png" in left("r")
    line = next(line for line in Path("r/report.md").read_text().splitlines() if "`energy.loss`" in line)
    reported = line.split("| ")[-1].strip(" |`")
    assert reported.startswith("touchstone run fall ")
    assert touchstone(f"{reported.removeprefix('touchstone ')} --out again --quiet")[0] == 0
    once, again = (pd.read_csv(f"{folder}/results.csv") for folder in ("r", "again"))
    assert again.engine.tolist() == ["mujoco"]
    assert again.value.tolist() == once.value[once.engine == "mujoco"].tolist()


def test_asking_twice_is_asking_once(touchstone, quick):
    """Engines, profiles and scenes named twice are played once."""
    again = "ball_snip --engine reference --profile balanced"
    _, out, _ = touchstone(f"{RUN} {again} --metric overlap.max --out r --format json")
    assert len(json.loads(out)) == 1


def test_a_long_run_is_refused_unless_it_is_asked_for(touchstone, refused, quick, monkeypatch, tmp_path):
    """Exit 2, one line and no folder; with --yes it plays."""
    monkeypatch.setattr(request, "LONGEST", -1.0)
    monkeypatch.setattr(request, "FIRST_SECONDS", 0.0)
    play = study.Children.play

    def slow(self, jobs, progress):
        for _ in range(9):
            progress("turn", 1)
        return play(self, jobs, progress)

    monkeypatch.setattr(study.Children, "play", slow)
    run = "run fall --engine reference --profile balanced --quiet --out new"
    assert "--yes plays them" in refused(run)
    assert not list(tmp_path.iterdir())
    assert touchstone(f"{run} --yes")[0] == 0
