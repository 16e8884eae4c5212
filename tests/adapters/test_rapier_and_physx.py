"""Rapier and PhysX in their environments: conformance, closed forms, what they report, what they refuse.
Without its environment (touchstone env add rapier, physx) an engine is skipped."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from touchstone.adapters.conformance.check import check
from touchstone.adapters.contract import Settings
from touchstone.adapters.recording import load as loaded
from touchstone.adapters.registry import (
    DEFAULT_ENGINES,
    ENGINES,
    installed,
    missing_reason,
    profiles_of,
    registered,
    settings_of,
)
from touchstone.adapters.workers.children import Children, Job
from touchstone.adapters.workers.play import play
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Capsule, Hull, PairCoefficients

PROFILES = {"rapier": ("recommended", "default", "accurate"), "physx": ("recommended", "default", "pgs")}
SPEED, MU, G, HALF = 3.0, 0.5, 9.81, 0.1


def needed(name, *values):
    """Values of a parametrised test, which is skipped where the engine is not installed."""
    skip = pytest.mark.skipif(not installed(name), reason=f"{name}: {missing_reason(name)}")
    return pytest.param(name, *values, marks=skip, id=" ".join((name, *map(str, values))))


EACH = [needed(name, profile) for name, profiles in PROFILES.items() for profile in profiles]
BOTH = [needed(name) for name in PROFILES]


@pytest.fixture(autouse=True)
def named():
    """Both are known as long as a test of this file runs."""
    before = dict(ENGINES)
    for name in PROFILES:
        registered(name)
    yield
    ENGINES.clear()
    ENGINES.update(before)


@pytest.fixture
def box(lab):
    """A cube on the ground."""
    return partial(lab.block, "box", (HALF, HALF, HALF), (0.0, 0.0, HALF))


def run_of(scenario, name, profile="recommended"):
    """A scene that plays to its end on a profile."""
    run = play(scenario, [(name, profile)])[name, profile]
    assert run.status == "done", run.reason
    return run


@pytest.mark.parametrize("name", PROFILES)
def test_they_play_only_when_they_are_named(name):
    """Neither is among the engines that play by default; its table has a column per profile."""
    assert name not in DEFAULT_ENGINES
    assert settings_of(name).profiles == tuple(profiles_of(name)) == PROFILES[name]


@pytest.mark.parametrize(("name", "profile"), EACH)
def test_the_adapter_conforms(name, profile):
    """The checks of conformance find no fault."""
    assert [(report.check, report.faults) for report in check(name, profile) if report.faults] == []


@pytest.mark.parametrize(
    ("name", "profile", "largest"),
    [
        *(needed("rapier", profile, 0.01) for profile in ("recommended", "default")),
        needed("rapier", "accurate", 0.07),  # it depends on the heading: docs/findings/rapier.md
        *(needed("physx", profile, 0.02) for profile in PROFILES["physx"]),
    ],
)
def test_a_box_slides_as_far_as_coulomb_says(name, profile, largest, lab, box):
    """A box stops after v^2 / (2 mu g) straight ahead."""
    scenario = lab.scene(lab.ground(), box(linear_velocity=(SPEED, 0.0, 0.0)), mu=MU, duration=1.0)
    run = run_of(scenario, name, profile)
    assert run.recording.position[-1, 1, 0] == pytest.approx(SPEED**2 / (2 * MU * G), rel=largest)


@pytest.mark.parametrize("name", BOTH)
def test_a_hull_rests_on_its_face(name, lab, box):
    """A cube of eight vertices stays where a box does."""
    scenario = lab.scene(lab.ground(), box(), duration=0.2)
    ground, cube = scenario.bodies
    corners = tuple((x, y, z) for x in (-HALF, HALF) for y in (-HALF, HALF) for z in (-HALF, HALF))
    hull = replace(cube, pieces=(replace(cube.pieces[0], shape=Hull(corners)),))
    run = run_of(replace(scenario, bodies=(ground, hull)), name)
    np.testing.assert_allclose(run.recording.position[-1, 1], cube.position, atol=1e-3)


@pytest.mark.parametrize("name", BOTH)
def test_a_capsule_stands_along_its_z_axis(name, lab, box):
    """Upright on a flat ground, its centre is half its length and a radius above it."""
    scenario = lab.scene(lab.ground(), box(), duration=0.2, mu=MU)
    ground, cube = scenario.bodies
    capsule = replace(
        cube, position=(0.0, 0.0, 0.35), pieces=(replace(cube.pieces[0], shape=Capsule(0.1, 0.25)),)
    )
    run = run_of(replace(scenario, bodies=(ground, capsule)), name)
    assert run.recording.position[-1, 1, 2] == pytest.approx(0.35, abs=2e-3)


@pytest.mark.parametrize("name", BOTH)
def test_a_prescribed_body_carries_another(name):
    """A load on a platform that moves too gently for it to slip has its velocity, to a step."""
    run = run_of(catalogue()["platform_stick"], name)
    names = [body.name for body in catalogue()["platform_stick"].bodies]
    load, platform = (run.recording.linear_velocity[:, names.index(one), 0] for one in ("load", "platform"))
    assert platform.max() > 1.0
    np.testing.assert_allclose(load, platform, atol=0.06)


@pytest.mark.parametrize("name", BOTH)
def test_a_posed_hand_pushes_a_ball(name, tmp_path):
    """Driven links are kinematic under the drive `posed`, and push what they meet."""
    settings = Settings("recommended", profiles_of(name)["recommended"], drive="posed")
    job = Job(name, catalogue()["ball_snip"], settings, tmp_path / "run.npz", tmp_path / "output.txt")
    with Children() as children:
        (outcome,) = children.play([job], lambda label, frames: None)
    assert outcome.status == "done", outcome.reason
    assert np.linalg.norm(loaded(job.recording).linear_velocity[-1], axis=1).max() > 0.1


@pytest.mark.parametrize("name", BOTH)
def test_coupled_bodies_are_refused(name):
    """One line says what the adapter lacks, and what to choose."""
    run = play(catalogue()["grip"], [(name, "recommended")])[name, "recommended"]
    assert (run.status, run.reason) == (
        "skipped",
        f"{name}: the adapter has no coupled bodies; choose --drive posed",
    )


@pytest.mark.parametrize("name", [needed("rapier")])
def test_friction_impulses_of_rapier_balance_the_momentum(name, lab, box):
    """In `accurate`, the impulses of a sliding box are the change of its momentum, at an odd heading."""
    velocity = SPEED * np.array([np.cos(0.7), np.sin(0.7), 0.0])
    scenario = lab.scene(lab.ground(), box(linear_velocity=tuple(velocity)), mu=MU, duration=0.2)
    recording = run_of(scenario, name, "accurate").recording
    change = recording.linear_velocity[-1, 1] - velocity  # of 1 kg
    assert recording.contacts["body_b"].tolist() == [1] * len(recording.contacts)
    weight = np.array([0.0, 0.0, G * 0.2])
    np.testing.assert_allclose(recording.contacts["impulse"].sum(axis=0) - weight, change, atol=1e-4)


@pytest.mark.parametrize("name", [needed("rapier")])
def test_rapier_takes_a_combine_rule_that_gives_each_pair_its_friction(name, lab):
    """Where no mean does, the product of both does; the manifest reads both back."""
    scenario = lab.scene(lab.ground(), lab.ball("one", (0.0, 0.0, 0.05)), lab.ball("two", (0.3, 0.0, 0.05)))
    floor, one, two = scenario.bodies
    table = (
        PairCoefficients("wood", "wood", 0.0, 0.9),
        PairCoefficients("wood", "metal", 0.0, 0.09),
        PairCoefficients("metal", "metal", 0.0, 0.3),
    )
    metal = tuple(replace(body, material="metal") for body in (one, two))
    mixed = replace(scenario, bodies=(floor, *metal), coefficients=table)
    facts = run_of(mixed, name).recording.facts
    assert facts["settings"]["friction_rule"] == "CoefficientCombineRule.MULTIPLY"
    found = sorted(group["friction"] for group in facts["pairs"])
    assert found == pytest.approx([0.09, 0.3], abs=1e-6)


@pytest.mark.parametrize(("name", "profile", "rises"), [
    needed("physx", "default", False), needed("physx", "recommended", True),
])  # fmt: skip
def test_physx_bounces_from_its_threshold_on(name, profile, rises, lab):
    """A ball with e = 1 that falls 0.1 m meets the ground at 1.4 m/s: below 2 m/s, above 0.2 m/s."""
    scenario = lab.scene(lab.ground(), lab.ball("ball", (0.0, 0.0, 0.15)), e=1.0, duration=0.3)
    height = run_of(scenario, name, profile).recording.position[:, 1, 2]
    assert (height[-1] > 0.1) == rises
