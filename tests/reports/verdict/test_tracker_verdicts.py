"""Verdicts with noisy trackers: laws are judged, what follows from the ideal tracker is not, and says so."""

from dataclasses import replace
from math import isnan

import pytest

from touchstone.adapters.contract import Settings
from touchstone.reports.results import UNAPPLIED, Row
from touchstone.reports.verdict import failings, limits
from touchstone.reports.verdict.failings import NOISY, Failing
from touchstone.reports.verdict.judge import NOT_IDEAL, counted, judged

LABEL = f"balanced{NOISY}"
ROW = Row("run", "wall_push", "reference", LABEL, 1 / 60, "overlap.max", 1e-7)
TAGS = ("gallery",)


def test_the_label_tells_the_tracker():
    """The label of rows and files names noisy trackers, as it names another drive."""
    assert Settings("balanced", 1 / 60, tracker="noisy").label == LABEL
    both = Settings("recommended", 1 / 240, drive="torque", tracker="noisy").label
    assert both == "recommended, drive=torque, tracker=noisy"
    assert Settings("balanced", 1 / 60).label == "balanced"


@pytest.mark.parametrize(
    ("metric", "passing", "failing"),
    [
        ("overlap.max", 1e-7, 1e-3),
        ("overlap.tunnelled", 0.0, 1.0),
        ("solver.residual", 1e-9, 1e-3),
        ("friction.cone", 0.0, 0.1),
        ("energy.injected", 0.0, 1e-3),
    ],
)
def test_laws_hold_whatever_the_tracker(metric, passing, failing):
    """Judge a law by the limit of the profile without its tracker."""
    assert judged(replace(ROW, metric=metric, value=passing), TAGS).verdict == "pass"
    found = judged(replace(ROW, metric=metric, value=failing), TAGS)
    assert (found.verdict, found.profile) == ("fail", LABEL)


@pytest.mark.parametrize(
    "metric", ["contact.gap", "joint.speed", "posture.over_best", "contact.impulse_balance.driven"]
)
def test_limits_of_the_ideal_tracker_do_not_apply(metric):
    """Give no verdict, however large or small the value, and say why."""
    for value in (0.0, 1e3):
        found = judged(replace(ROW, metric=metric, value=value), TAGS)
        assert (found.verdict, found.basis, found.reason) == ("", UNAPPLIED, NOT_IDEAL)
        assert isnan(found.limit)


def test_an_expected_event_is_measured_alone():
    """Take the verdict of an event's window away, which is that of the ideal tracker."""
    found = judged(replace(ROW, metric="events.meet", value=2.0, low=1.9, high=2.5, verdict="pass"), TAGS)
    assert (found.verdict, found.basis, found.value) == ("", UNAPPLIED, 2.0)
    assert isnan(found.low)


def test_a_known_failing_excuses_without_a_bound():
    """Excuse a breach that is known with the ideal tracker, however large, and let it be gone."""
    known = replace(ROW, engine="mujoco", profile=f"recommended{NOISY}", value=0.5)
    assert judged(known, TAGS).verdict == "known"
    assert judged(replace(known, value=1e-5), TAGS).verdict == "pass"


def test_what_noise_alone_shows_may_be_known(monkeypatch):
    """Excuse what is documented of noisy trackers, and name the option in the line that shows it."""
    known = Failing(
        engine="mujoco", profile=f"recommended{NOISY}", scenario="ball_snip", metric="friction.direction",
        subject="table-ball", cause="mujoco.jerked",
    )  # fmt: skip
    assert "--profile recommended --tracker noisy --metric friction.direction" in known.reproduce
    monkeypatch.setattr(failings, "known", lambda: {known.key: known})
    row = replace(ROW, scenario="ball_snip", engine="mujoco", profile=known.profile, value=0.5)
    row = replace(row, metric="friction.direction", subject="table-ball")
    assert judged(row, TAGS).verdict == "known"
    assert judged(replace(row, profile="recommended"), TAGS).verdict == "fail"


def test_ideal_trackers_are_judged_as_ever():
    """Hand rows without the label to the limits."""
    assert judged(replace(ROW, profile="balanced", metric="joint.speed", value=1e3), TAGS).verdict == "fail"


def test_what_does_not_apply_is_counted():
    """Count a limit that does not apply as such, with its reason, and not as met."""
    rows = [judged(row, TAGS) for row in (ROW, replace(ROW, metric="joint.speed", value=1.0))]
    count = counted(rows, [("reference", LABEL)])["reference", LABEL]
    assert (count.text, count.not_applicable) == ("1 of 2 (1)", {"joint.speed": NOT_IDEAL})


TORQUE = "recommended, drive=torque"


def test_what_only_our_torques_cause_is_the_harness(monkeypatch) -> None:
    """Book a failing under explicit torques on the harness, unless the engine's own servos show it too."""
    limit = limits.Limit("energy.injected", 1.0, "a limit")
    monkeypatch.setattr(limits, "LIMITS", (limit,))
    monkeypatch.setattr(failings, "known", dict)
    row = Row("run", "wall_push", "bullet", TORQUE, 1 / 240, "energy.injected", 5.0, "J")
    found = judged(row, ())
    assert (found.verdict, found.basis, found.profile) == ("known", "harness", TORQUE)
    assert "explicit torques" in found.reason
    assert judged(replace(row, value=0.5), ()).verdict == "pass"
    own = judged(replace(row, profile="recommended"), ())
    assert (own.verdict, own.basis) == ("fail", "")
    thrown = Row("run", "slap_3", "bullet", TORQUE, 1 / 240, "run", verdict="error", reason="diverged")
    assert (judged(thrown, ()).verdict, judged(thrown, ()).basis) == ("known", "harness")
    assert judged(replace(thrown, profile="recommended"), ()).verdict == "error"
    known = Failing(
        engine="bullet",
        profile="recommended",
        scenario="wall_push",
        metric="energy.injected",
        cause="bullet.jammed",
    )
    monkeypatch.setattr(failings, "known", lambda: {known.key: known})
    assert (judged(row, ()).verdict, judged(row, ()).basis) == ("known", "")
