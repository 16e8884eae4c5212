"""Classes of outcome and verdicts with noisy trackers: every scripted failure is named, laws are judged."""

from dataclasses import replace
from math import isnan

import pytest
from scripted_engines import Engine

from touchstone.adapters.contract import Settings
from touchstone.reports.results import UNAPPLIED, Row
from touchstone.reports.studies.stability.play import FAILED, hard_cell, outcome, play_scenario, recordings_in
from touchstone.reports.verdict import failings, limits
from touchstone.reports.verdict.failings import NOISY, Failing
from touchstone.reports.verdict.judge import NOT_IDEAL, counted, judged
from touchstone.reports.verdict.outcomes import HARD_CLASSES, SILENT
from touchstone.scenarios.difficulty.family import families, hard_names, hard_scene, level_text

SCRIPTS = {
    "rests": "ok",
    "unsupported": "skipped",
    "raises": "error",
    "slow": "slow",
    "announces": "gave up",
    "sinks and says so": "gave up",
    "not finite": "non-finite",
    "finite position only": "exploded",
    "resets": "auto-reset",
    "explodes": "exploded",
    "spins up": "exploded",
    "tunnels": "tunnelled",
    "sinks": "sink-through",
    "lies about contacts": "sink-through",
    "creeps": "creep",
    "jitters": "jitter",
    "sinks a little": "inaccurate",
    "hovers": "inaccurate",
}
"""Script of a fake engine, and its class."""


@pytest.fixture
def scene():
    """A cube that rests on the floor."""
    return hard_scene("hard_strong_gravity_9.81")


@pytest.mark.parametrize(("script", "expected"), SCRIPTS.items())
def test_each_script_has_its_class(scene, script, expected):
    """A script of every class is recognised, with a reason for all but `ok`."""
    scenario, checks = scene
    budget = 0.2 if script == "slow" else 60.0
    found = play_scenario(Engine(script), scenario, checks, Settings("any", 1 / 60), budget)
    assert found.name == expected, found.reason
    assert bool(found.reason) == (expected != "ok")


def test_every_class_has_a_script():
    """No class is without a fake."""
    assert set(SCRIPTS.values()) == set(HARD_CLASSES)
    assert set(SILENT) < set(HARD_CLASSES)


def test_what_gave_up_keeps_the_failure_below(scene):
    """A failure that was announced names the silent class that it would have been."""
    scenario, checks = scene
    found = play_scenario(Engine("sinks and says so"), scenario, checks, Settings("any", 1 / 60))
    assert found.under == "sink-through"
    assert "gave_up" in found.reason


def test_an_allowed_overlap_is_one_at_the_start_alone(scene):
    """Where the scene starts in overlap, what remains of it later fails."""
    scenario, checks = scene
    body = replace(scenario.bodies[-1], position=(0.0, 0.0, 0.04))
    deep = replace(scenario, bodies=(*scenario.bodies[:-1], body), truths=())
    settings = Settings("any", 1 / 60)
    allowed, parted = (replace(checks, parted_by=end) for end in (float("inf"), 0.5))
    assert play_scenario(Engine("rests"), deep, allowed, settings).name == "ok"
    assert play_scenario(Engine("rests"), deep, parted, settings).name == "inaccurate"


def test_a_failed_cell_keeps_its_recording(tmp_path):
    """A failed run leaves its recording, one that is ok leaves none."""
    cell = hard_cell("hard_strong_gravity_9.81", "fake", "any", 1 / 60)
    for fault, name, count in (("tunnels", "tunnelled", 1), ("rests", "ok", 0)):
        folder = tmp_path / fault
        with recordings_in(FAILED, folder):
            measured = outcome(cell, hard_scene(cell.scenario)[0], Engine(fault))
        assert measured.rows[0].subject == name
        assert len(list(folder.glob("*.npz"))) == count


def test_names_of_hard_scenes_are_known_without_building_them(monkeypatch):
    """Names and levels need no scene; each scene has the name that it is listed by."""
    monkeypatch.setattr("touchstone.scenarios.difficulty.family.Family.scene", None)
    assert len(hard_names()) == sum(len(one.levels) for one in families().values())
    assert level_text(1e-5) == "1e-5"
    assert level_text(1e6) == "1e6"


@pytest.mark.parametrize("name", families())
def test_every_level_is_a_valid_scene(name):
    """All levels of a family build, in the tag `hard`, with steps from 1/30 s on."""
    family = families()[name]
    assert family.summary
    for level in family.levels:
        scenario, _ = family.scene(level)
        assert scenario.name == family.scene_name(level)
        assert scenario.tags[0] == "hard"
        assert scenario.frame_rate == 30


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
