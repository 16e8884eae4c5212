"""`volley`: thrown balls fly on parabolas, are hit by Newton's law, and their momenta balance."""

import numpy as np
import pytest

from touchstone.reports.metrics import METRICS
from touchstone.reports.metrics.context import Context
from touchstone.scenarios.avatar.kinematics import tracked_poses
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.families.volley import HITS
from touchstone.scenarios.scenario import GRAVITY

BALLS = [f"ball_{k}" for k in range(1, len(HITS) + 1)]
SWEPT = ("balanced", "accurate")


@pytest.fixture(scope="module")
def scene():
    """The scene."""
    return catalogue()["volley"]


@pytest.fixture(scope="module")
def hits(registry, scene):
    """Contact rows of a ball with the person under a profile of the reference."""

    def rows(profile: str, ball: str) -> np.ndarray:
        contacts, driven = registry.played("volley", "reference", profile).contacts, scene.groups()
        person = [k for k, group in enumerate(driven) if group >= 0]
        return contacts[np.isin(contacts["body_a"], person) & (contacts["body_b"] == scene.body_index(ball))]

    return rows


@pytest.mark.parametrize("profile", SWEPT)
@pytest.mark.parametrize("ball", BALLS)
def test_a_ball_flies_on_its_parabola_until_it_is_hit(registry, scene, hits, profile, ball):
    """Follow the closed form in every frame before the first contact, and leave the hand with e times the
    speed of approach, at the first touch of each."""
    recording, body = registry.played("volley", "reference", profile), scene.body_index(ball)
    t = recording.time[recording.time <= hits(profile, ball)["time"].min()][:, None]
    start = scene.bodies[body]
    arc = start.position + np.array(start.linear_velocity) * t - np.array((0, 0, GRAVITY / 2)) * t**2
    assert len(t) > 20
    # exact for constant forces: rounding over the frames
    np.testing.assert_allclose(recording.position[: len(t), body], arc, atol=1e-12)
    first = hits(profile, ball)[0]
    before, after = (
        (first[f"velocity_b_{moment}"] - first[f"velocity_a_{moment}"]) @ first["normal"]
        for moment in ("before", "after")
    )
    e, _ = scene.pair_coefficients(int(first["body_a"]), int(first["body_b"]))
    assert before < -1.0
    assert after == pytest.approx(-e * before, abs=1e-9)  # the solver's tolerance


@pytest.mark.parametrize("profile", SWEPT)
def test_the_balls_momenta_balance(registry, scene, profile):
    """Account for every change of a ball's momentum by gravity and by the impulses on it."""
    context = Context(registry.played("volley", "reference", profile), scene)
    found = METRICS["contact.impulse_balance"].measure(context)
    assert set(found) == set(BALLS)
    assert max(found.values()) < 1e-9  # rounding, and the solver's tolerance


@pytest.mark.parametrize("profile", SWEPT)
def test_the_arm_hits_as_fast_as_it_moves_and_is_held_back_by_the_wall(registry, scene, hits, profile):
    """Meet the first ball with the speed of the hand by its tracker; show the arm another posture than its
    tracker has, at the moment of the second hit."""
    recording = registry.played("volley", "reference", profile)
    frame = round(HITS[1][0] * scene.frame_rate) - 2
    tracked = sample(scene.trackers[0], recording.time[frame : frame + 1]).angle[0]
    away = np.abs(recording.joint_angle[frame] - tracked)
    arm = [k for k, name in enumerate(scene.trackers[0].joints) if name.startswith("right_")]
    assert away[arm].max() > 5e-3
    assert away.max() == away[arm].max()
    first = hits(profile, BALLS[0])[0]
    times = float(first["time"]) + np.array((-1.0, 1.0)) / 240
    place, _ = tracked_poses(scene, scene.trackers[0], times)
    links = list(scene.links(scene.trackers[0]))
    hand = place[:, links.index(scene.body_index("right_hand")), 0]
    side = "a" if first["body_a"] == scene.body_index("right_hand") else "b"
    # the hand's middle is a tenth faster than its wrist
    assert first[f"velocity_{side}_before"][0] == pytest.approx(float(np.diff(hand)[0]) * 120, rel=0.2)
