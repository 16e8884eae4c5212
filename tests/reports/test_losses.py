"""Where the reference loses: filled from rows, with paper beside balanced, and nothing that is rounding."""

from __future__ import annotations

from math import nan

import pytest

from touchstone.reports.results import Row, table
from touchstone.reports.views.losses import HEADS, loss_rows, scene_lines, unmeasured_lines


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


def test_other_profiles_of_engines_do_not_count() -> None:
    """Compare with recommended engines; without engines there is nothing to lose."""
    rows = [row("reference", "overlap.max", 1e-3), row("dart", "overlap.max", 0.0, profile="accurate")]
    assert loss_rows(table(rows)) == []


def test_what_only_engines_measure_is_told() -> None:
    """Tell what the reference does not measure although an engine does, with the reason, once."""
    rows = [
        *(row("reference", "friction.cone", nan, s, verdict="skipped", reason="no impulses") for s in "ab"),
        *(row("dart", "friction.cone", 0.1, scene) for scene in "ab"),
        row("reference", "rest.speed", nan, "a", verdict="skipped", reason="nothing rests"),
    ]
    assert unmeasured_lines(table(rows)) == ["the engines only: friction.cone (a, b): no impulses"]
