"""Newton in its environment: conformance, friction by its combine rules, what it refuses. Without the
environment (touchstone env add newton) all is skipped."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from touchstone.adapters.conformance.check import check
from touchstone.adapters.registry import DEFAULT_ENGINES, ENGINES, installed, missing_reason, registered
from touchstone.adapters.workers.play import play
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Hull, PairCoefficients

pytestmark = pytest.mark.skipif(not installed("newton"), reason=f"newton: {missing_reason('newton')}")
SPEED, MU, G, HALF = 3.0, 0.5, 9.81, 0.1


@pytest.fixture(autouse=True)
def named():
    """Newton is known as long as a test of this file runs."""
    before = dict(ENGINES)
    registered("newton")
    yield
    ENGINES.clear()
    ENGINES.update(before)


@pytest.fixture
def box(lab):
    """A cube on the ground."""
    return partial(lab.block, "box", (HALF, HALF, HALF), (0.0, 0.0, HALF))


def run_of(scenario, profile="xpbd"):
    """A scene on a profile."""
    return play(scenario, [("newton", profile)])["newton", profile]


def test_it_plays_only_when_it_is_named():
    """Newton is not among the engines that play by default."""
    assert "newton" not in DEFAULT_ENGINES


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["xpbd", "mujoco", "mujoco-elliptic", "steel", "kamino"])
def test_the_adapter_conforms(profile):
    """The checks of conformance find no fault."""
    registered("newton")
    assert [(report.check, report.faults) for report in check("newton", profile) if report.faults] == []


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["xpbd", "mujoco-elliptic", "steel", "kamino"])
def test_a_box_slides_as_far_as_coulomb_says(profile, lab, box):
    """A box stops after v^2 / (2 mu g) straight ahead, within 2 %."""
    scenario = lab.scene(lab.ground(), box(linear_velocity=(SPEED, 0.0, 0.0)), mu=MU, duration=1.0)
    run = run_of(scenario, profile)
    assert run.status == "done", run.reason
    assert run.recording.position[-1, 1, 0] == pytest.approx(SPEED**2 / (2 * MU * G), rel=0.02)


def test_friction_has_a_factor_per_body(lab):
    """Each pair has its own coefficient by the mean of both; the manifest reads it back."""
    scenario = lab.scene(lab.ground(), lab.ball("one", (0.0, 0.0, 0.05)), lab.ball("two", (0.1, 0.0, 0.05)))
    floor, one, two = scenario.bodies
    table = (
        PairCoefficients("wood", "wood", 0.0, 0.5),
        PairCoefficients("wood", "metal", 0.0, 0.4),
        PairCoefficients("metal", "metal", 0.0, 0.3),
    )
    mixed = replace(scenario, bodies=(floor, replace(one, material="metal"), two), coefficients=table)
    run = run_of(mixed, "steel")
    assert run.status == "done", run.reason
    found = {
        tuple(sorted((a, b))): group["friction"]
        for group in run.recording.facts["pairs"]
        for a in group["bodies_a"]
        for b in group["bodies_b"]
        if a != b
    }
    assert found == pytest.approx({("ground", "one"): 0.4, ("ground", "two"): 0.5, ("one", "two"): 0.4})


@pytest.mark.parametrize(
    ("name", "profile", "reason"),
    [
        ("ball_snip", "xpbd", "newton: the adapter has no driven or prescribed bodies"),
        ("bounce_e1", "mujoco", "newton: restitution must be 0 or up to 0.3, found 1 for the pairs"),
        ("fall", "kamino", "newton: Kamino steps no scene in which nothing can touch"),
    ],
)
def test_what_it_cannot_represent_is_refused(name, profile, reason):
    """Say which solver lacks what."""
    run = run_of(catalogue()[name], profile)
    assert run.status == "skipped"
    assert run.reason.startswith(reason)


def test_a_hull_rests_on_its_face(lab, box):
    """A cube of eight vertices stays where a box does."""
    scenario = lab.scene(lab.ground(), box(), duration=0.2)
    ground, cube = scenario.bodies
    corners = tuple((x, y, z) for x in (-HALF, HALF) for y in (-HALF, HALF) for z in (-HALF, HALF))
    hull = replace(cube, pieces=(replace(cube.pieces[0], shape=Hull(corners)),))
    run = run_of(replace(scenario, bodies=(ground, hull)), "steel")
    assert run.status == "done", run.reason
    np.testing.assert_allclose(run.recording.position[-1, 1], cube.position, atol=1e-3)
