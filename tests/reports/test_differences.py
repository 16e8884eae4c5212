"""Differences between engines: who stands apart, by how much, how to see it again, and a fifth engine."""

from math import nan
from pathlib import Path

import numpy as np
import pytest

from touchstone.adapters.registry import ENGINES, Entry
from touchstone.reports.metrics import METRICS
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.time_series import FORCE, Course, course
from touchstone.reports.results import Row, table
from touchstone.reports.runner.request import Request, Results, columns_of
from touchstone.reports.views.comparison import (
    PICTURES,
    TOPICS,
    command,
    draw,
    not_played,
    sections,
    worst_lines,
)
from touchstone.reports.views.findings import HEADS, loss_rows, scene_lines, unmeasured_lines
from touchstone.reports.views.markdown import report
from touchstone.reports.views.pictures import INK, color_of, detector_color, marker_of
from touchstone.scenarios.catalogue import catalogue

PROFILES = {engine: next(iter(entry.profiles)) for engine, entry in ENGINES.items()}


def request_for(*names, **more):
    scenes = tuple(catalogue()[name] for name in names)
    return Request(scenes, columns_of(ENGINES, PROFILES.values()), Path("out"), **more)


def rows(scenario, metric, values, subject="", limits=None):
    """One row per engine of a metric."""
    limits = limits or {}
    return [
        Row(
            *("run", scenario, engine, PROFILES[engine], ENGINES[engine].profiles[PROFILES[engine]], metric),
            value,
            METRICS[metric].unit,
            subject,
            limit=limits.get(engine, nan),
        )
        for engine, value in values.items()
    ]


def only_line(name, *made, scenes=("fall",), **more):
    """The one line of a topic, and the request."""
    request = request_for(*scenes, **more)
    found = sections(request, Results(table([row for part in made for row in part])))
    section = next(section for section in found if section.topic.name == name)
    assert len(section.lines) == 1
    return section.lines[0], request


@pytest.mark.parametrize(
    ("values", "outlier", "nearest"),
    [
        ({"reference": 0.0, "dart": 1e-3, "bullet": 2e-3, "mujoco": 9e-3}, "mujoco +8.00 mm", ["reference"]),
        ({"reference": 9e-3, "dart": 0.0, "bullet": 5e-7, "mujoco": 0.0}, "reference +9.00 mm",
         ["dart", "bullet", "mujoco"]),
        ({"reference": 5e-3, "dart": 5e-3, "bullet": 1e-3}, "bullet -4.00 mm, nearest to the truth",
         ["bullet"]),
        ({"dart": 1e-3, "mujoco": 3e-3}, "mujoco +2.00 mm", ["dart"]),
    ],
)  # fmt: skip
def test_the_outlier_is_named_with_its_distance(values, outlier, nearest):
    """Name the engine farthest from the median of the others, whoever it is, and all nearest to 0."""
    line, _ = only_line("overlap", rows("fall", "overlap.max", values))
    assert line.outlier_text == outlier
    assert line.nearest == nearest


def test_times_stand_apart_by_a_ratio():
    """Compare times as ratios: a tenth is as far away as ten times."""
    values = {"reference": 1e-5, "dart": 4e-4, "bullet": 1e-4, "mujoco": 2e-4}
    line, request = only_line("timing", rows("fall", "time.frame.median", values))
    assert line.outlier_text == "reference 0.0500 times"
    assert line.nearest == ["reference"]
    both = "--engine reference --engine dart --profile balanced --profile recommended"
    assert command(request, line) == f"touchstone run fall {both} --metric time.frame.median"


def test_the_worst_is_what_misses_its_limit_by_most():
    """Reproduce the line and the engine that are farthest beyond their limits, not the largest number."""
    strict = {"reference": 1e-6, "dart": 1e-3, "bullet": 1e-3, "mujoco": 1e-3}
    overlap = rows("fall", "overlap.max", {"reference": 1e-5, "dart": 2e-3, "mujoco": 0.0}, limits=strict)
    gap = rows("fall", "contact.gap", {"reference": 0.0, "dart": -3e-3, "mujoco": 0.0}, "a-b", limits=strict)
    results = Results(table(overlap + gap))
    section = sections(request_for("fall"), results)[0]
    assert [line.worst for line in section.lines] == ["reference", "dart"]
    words = "--engine reference --profile balanced --metric overlap.max"
    assert command(request_for("fall"), worst_lines(section)["fall"]) == f"touchstone run fall {words}"


def test_the_pair_that_differs_most_is_shown():
    """Of several subjects take the one that most engines have and on which they differ most."""
    made = [
        rows("fall", "contact.gap", {"reference": 0.0, "dart": 1e-4, "mujoco": 0.0}, "near"),
        rows("fall", "contact.gap", {"reference": 0.0, "dart": 4e-4, "mujoco": 0.0}, "far"),
        rows("fall", "contact.gap", {"reference": 0.0, "dart": 9e-4}, "lonely"),
    ]
    assert only_line("overlap", *made)[0].subject == "far"


def test_the_page_tells_all_four_words():
    """Write a table, a picture and the best of each topic; say who did not play and what has no figure."""
    made = [
        rows("fall", "overlap.max", {"reference": 0.0, "bullet": 1e-3, "mujoco": 3e-3}),
        rows("fall", "energy.loss", {"reference": 0.0, "bullet": 0.0, "mujoco": 0.0}),
        rows("roll", "energy.loss", {"reference": nan, "bullet": 0.0, "mujoco": -0.1}),
        rows("fall", "time.frame.median", {"reference": 2e-5, "bullet": 1e-5, "mujoco": 3e-5}),
    ]
    made[2][0] = Row(
        *("run", "roll", "reference", "balanced", 1 / 60, "energy.loss"), reason="no way to know"
    )
    gone = Row("run", "fall", "dart", "recommended", nan, "run", verdict="skipped", reason="not installed")
    results = Results(table([*(row for part in made for row in part), gone]))
    page = report(request_for("fall", "roll"), results)
    assert "- not played: dart: skipped: not installed" in page
    for topic in TOPICS:
        assert f"### Differences in {topic.name}\n" in page
    pictured = [topic.name for topic in TOPICS if f"({topic.name}.png)" in page]
    assert pictured == ["overlap", "energy", "timing"]
    assert "- bullet shortest on 1 of 1 line: fall time.frame.median" in page
    assert "- reference, `energy.loss`: no way to know (roll)" in page
    assert "- no engine apart: fall" in page
    assert "- no figure of two engines: fall, roll" in page
    assert "| mujoco +2.50 mm | `touchstone run fall --engine mujoco --profile recommended" in page


def test_one_engine_has_no_differences(tmp_path):
    """Say so in one line, and draw nothing."""
    results = Results(table(rows("fall", "overlap.max", {"dart": 1e-3})))
    page = report(request_for("fall"), results)
    assert "Fewer than two engines played: no differences to show." in page
    assert "### Differences in" not in page
    draw(request_for("fall"), results, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_what_fails_once_is_told_with_its_scenes():
    """Tell an engine that failed in one scene of two with that scene, and nothing of other profiles."""
    made = [Row("run", s, "dart", "recommended", 1 / 1020, "overlap.max", 1.0) for s in ("fall", "roll")]
    made += [
        Row("run", "roll", "dart", profile, 1 / 240, "run", verdict="error", reason="died")
        for profile in ("recommended", "equal-step")
    ]
    assert not_played(Results(table(made))) == ["dart: error: died (roll)"]


@pytest.mark.parametrize("names", [("ball_snip",), tuple(catalogue())[::5]])
def test_pictures_of_one_scene_and_of_many(names, tmp_path, recordings):
    """Draw every topic for one scene and for all there are, with and without courses and frame times."""
    metrics = ("overlap.max", "energy.injected", "friction.cone", "friction.deficit", "time.frame.median")
    sizes = {"reference": 0.0, "dart": 1e-4, "bullet": 1e-2, "mujoco": 1.0}
    made = [row for name in names for metric in metrics for row in rows(name, metric, sizes)]
    results = Results(table(made))
    time = np.linspace(0, 1, 61)
    for engine, profile in PROFILES.items():
        key = (names[0], engine, profile)
        results.courses[key] = Course(time, {("overlap.max", ""): sizes[engine] * np.sin(time) ** 2})
        results.recordings[key] = recordings.recording(
            catalogue()[names[0]], time_frame=1e-5 + sizes[engine] * time
        )
    draw(request_for(*names), results, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(f"{name}.png" for name in PICTURES)
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in tmp_path.iterdir())


def test_courses_end_in_their_metric(registry):
    """Have the metric as the largest value of its course, whatever the subject."""
    scenario, recording = catalogue()["ball_snip"], registry.played("ball_snip", "reference")
    context = Context(recording, scenario)
    found = course(context)
    assert found.time is recording.time
    pairs = {(FORCE, f"{pair}-ball") for pair in ("floor", "table", "palm")}
    energies = {("energy.injected", subject) for subject in ("simulated", "driven")}
    assert set(found.values) == {("overlap.max", ""), *energies, *pairs}
    for (metric, subject), values in found.values.items():
        assert len(values) == len(recording.time)
        if metric == FORCE:
            assert np.nanmax(values) == METRICS["force.contact.peak"].measure(context)[subject]
            continue
        assert values.max() == METRICS[metric].measure(context)[subject]


def row(engine: str, metric: str, value: float, scene: str = "stack", **more) -> Row:
    """A row of an engine's column that is compared; `profile` for another one of the reference."""
    profile = more.pop("profile", "balanced" if engine == "reference" else "recommended")
    return Row("run", scene, engine, profile, 1 / 60, metric, value, **more)


def test_a_metric_in_which_an_engine_is_better_is_told() -> None:
    """Name scenes lost of those compared, the worst one, both of our profiles and the best engine."""
    rows = [
        row("reference", "contact.gap", 2e-4, subject="a-b"),
        row("reference", "contact.gap", 5e-4, subject="a-b", profile="paper"),
        row("mujoco", "contact.gap", -1e-4, subject="a-b"),
        row("dart", "contact.gap", 3e-4, subject="a-b"),
        row("reference", "contact.gap", 1e-4, "slide", subject="a-b"),
        row("mujoco", "contact.gap", 9e-4, "slide", subject="a-b"),
    ]
    ((name, unit, scenes, place, balanced, paper, best),) = loss_rows(table(rows))
    assert (name, unit, scenes, place) == ("contact.gap", "mm", "1 of 2", "stack a-b")
    assert (balanced, paper, best) == ("0.200", "0.500", "mujoco -0.100")
    assert len(HEADS) == 7


@pytest.mark.parametrize(
    ("metric", "ours", "theirs", "limit"),
    [
        ("overlap.max", 9e-7, 0.0, nan),  # a tolerance of the method
        ("energy.injected", 1e-12, 0.0, nan),  # rounding
        ("friction.stop", 1.01e-3, 1e-3, nan),  # 1 %
        ("contact.gap", 6e-6, 0.0, 1e-3),  # less than a hundredth of the limit
        ("overlap.max", 1e-3, 2e-3, nan),  # better
        ("events.touch", 2.0, 1.0, nan),  # no direction
    ],
)
def test_what_is_no_loss_is_not_told(metric: str, ours: float, theirs: float, limit: float) -> None:
    """Leave out tolerances, rounding, and figures that are better or have no direction."""
    rows = [row("reference", metric, ours, limit=limit), row("dart", metric, theirs)]
    assert loss_rows(table(rows)) == []


def test_every_scene_has_its_line() -> None:
    """Tell per scene what is lost, with both figures, and where the engines are faster; then the others."""
    rows = [
        row("reference", "contact.gap", 2e-4, subject="a-b"),
        row("mujoco", "contact.gap", 1e-4, subject="a-b"),
        row("reference", "contact.gap", 9e-4, subject="a-c"),
        row("mujoco", "contact.gap", 1e-4, subject="a-c"),
        row("reference", "ratio.time", 1.29, subject="mujoco equal-step", profile="equal-step"),
        row("reference", "ratio.time", 0.9, "fall", subject="dart recommended"),
        row("reference", "contact.gap", 0.0, "slide"),
        row("mujoco", "contact.gap", 1e-4, "slide"),
    ]
    assert scene_lines(table(rows)) == [
        "stack: contact.gap 0.900 mm, mujoco 0.100 mm; "
        "equal-step takes 1.29 of the time of mujoco equal-step",
        "in nothing: slide",
    ]


def test_what_only_engines_measure_is_told() -> None:
    """Print once what the reference does not measure although an engine does, with the reason."""
    rows = [
        *(row("reference", "friction.cone", nan, s, verdict="skipped", reason="no impulses") for s in "ab"),
        *(row("dart", "friction.cone", 0.1, scene) for scene in "ab"),
        row("reference", "rest.speed", nan, "a", verdict="skipped", reason="nothing rests"),
    ]
    assert unmeasured_lines(table(rows)) == ["the engines only: friction.cone (a, b): no impulses"]


FIFTH = "fifth"


@pytest.fixture
def fifth(monkeypatch):
    """The registry with a fifth engine, which needs a package that every machine has."""
    monkeypatch.setitem(ENGINES, FIFTH, Entry("nowhere:Engine", "numpy", {"recommended": 1 / 240}))
    return FIFTH


def test_an_entry_without_looks_has_some(fifth):
    """The colour and the marker that no entry states are those of no other engine."""
    others = [name for name in ENGINES if name != fifth]
    assert color_of(fifth) not in map(color_of, others)
    assert marker_of(fifth) not in map(marker_of, others)
    assert detector_color(f"{fifth}.tight") == color_of(fifth)
    assert detector_color("unknown") == INK


def test_pictures_and_report_show_it(fifth, tmp_path: Path):
    """Pictures of the differences and the report are drawn with a column of the fifth engine."""
    columns = columns_of(ENGINES, ["balanced", "recommended"])
    request = Request((catalogue()["fall"],), columns, tmp_path)
    rows = [
        Row("run", "fall", engine, profile, ENGINES[engine].profiles[profile], "overlap.max", 1e-3 * k, "m")
        for k, (engine, profile) in enumerate(columns)
    ]
    results = Results(table(rows))
    draw(request, results, tmp_path)
    assert fifth in report(request, results)
    assert {path.read_bytes()[:4] for path in tmp_path.glob("*.png")} == {b"\x89PNG"}
