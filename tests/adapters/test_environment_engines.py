"""Newton, Rapier and PhysX in their environments: conformance, closed forms, what they report and refuse.
Without its environment (touchstone env add newton, rapier, physx) an engine is skipped."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from touchstone.adapters.conformance.check import check
from touchstone.adapters.contract import Settings
from touchstone.adapters.recording import load as loaded
from touchstone.adapters.registry import (
    DEFAULT_ENGINES,
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

PROFILES = {
    "rapier": ("recommended", "default", "accurate"),
    "physx": ("recommended", "default", "pgs"),
    "newton": ("xpbd", "mujoco", "mujoco-elliptic", "steel", "kamino"),
}
NO_HINGES = "the adapter has no hinges of driven bodies"
SPEED, MU, G, HALF = 3.0, 0.5, 9.81, 0.1


def needed(name, *values, slow=False):
    """Values of a parametrised test, which is skipped where the engine is not installed."""
    skip = pytest.mark.skipif(not installed(name), reason=f"{name}: {missing_reason(name)}")
    marks = (skip, pytest.mark.engines, *((pytest.mark.slow,) if slow else ()))
    return pytest.param(name, *values, marks=marks, id=" ".join((name, *map(str, values))))


EACH = [
    needed(name, profile, slow=name == "newton")
    for name, profiles in PROFILES.items()
    for profile in profiles
]
BOTH = [needed(name) for name in ("rapier", "physx")]


@pytest.fixture(autouse=True)
def named():
    """All are known as long as a test of this file runs."""
    for name in PROFILES:
        registered(name)


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
    """None is among the engines that play by default; its table has a column per profile."""
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
        *(needed("newton", p, 0.02, slow=True) for p in ("xpbd", "mujoco-elliptic", "steel", "kamino")),
    ],
)
def test_a_box_slides_as_far_as_coulomb_says(name, profile, largest, lab, box):
    """A box stops after v^2 / (2 mu g) straight ahead."""
    scenario = lab.scene(lab.ground(), box(linear_velocity=(SPEED, 0.0, 0.0)), mu=MU, duration=1.0)
    run = run_of(scenario, name, profile)
    assert run.recording.position[-1, 1, 0] == pytest.approx(SPEED**2 / (2 * MU * G), rel=largest)


@pytest.mark.parametrize(
    ("name", "profile"),
    [needed("rapier", "recommended"), needed("physx", "recommended"), needed("newton", "steel")],
)
def test_a_hull_rests_on_its_face(name, profile, lab, box):
    """A cube of eight vertices stays where a box does."""
    scenario = lab.scene(lab.ground(), box(), duration=0.2)
    ground, cube = scenario.bodies
    corners = tuple((x, y, z) for x in (-HALF, HALF) for y in (-HALF, HALF) for z in (-HALF, HALF))
    hull = replace(cube, pieces=(replace(cube.pieces[0], shape=Hull(corners)),))
    run = run_of(replace(scenario, bodies=(ground, hull)), name, profile)
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


@pytest.mark.parametrize(
    ("name", "profile", "scene", "reason"),
    [
        needed("rapier", "recommended", "ball_snip", f"{NO_HINGES}; choose --drive posed"),
        needed("physx", "recommended", "ball_snip", f"{NO_HINGES}; choose --drive posed"),
        needed("newton", "xpbd", "ball_snip", NO_HINGES),
        needed("newton", "xpbd", "platform_stick", "the adapter has no kinematic bodies"),
        needed("newton", "mujoco", "bounce_e1", "restitution must be 0 or up to 0.3, found 1 for the pairs"),
        needed("newton", "kamino", "fall", "Kamino steps no scene in which nothing can touch"),
    ],
)
def test_what_cannot_be_represented_is_refused(name, profile, scene, reason):
    """One line says what the adapter or the solver lacks."""
    run = play(catalogue()[scene], [(name, profile)])[name, profile]
    assert run.status == "skipped"
    assert run.reason.startswith(f"{name}: {reason}")


@pytest.mark.parametrize(
    ("name", "profile"),
    [
        *(needed("physx", profile) for profile in PROFILES["physx"]),
        *(needed("newton", profile, slow=True) for profile in ("steel", "kamino")),
    ],
)
def test_plates_hold_a_cube(name, profile):
    """`grip`: friction of the plates carries the cube; each pair has its own."""
    scenario = catalogue()["grip"]
    run = run_of(scenario, name, profile)
    height = run.recording.position[:, scenario.body_index("cube"), 2]
    assert height[-1] == pytest.approx(0.04, abs=1e-3)
    assert abs(height[-1] - height[120]) < 1e-4
    found = {round(group["friction"], 6) for group in run.recording.facts["pairs"]}
    assert found == {0.3, 0.7}


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


@pytest.mark.parametrize("name", [needed("newton")])
def test_friction_of_newton_has_a_factor_per_body(name, lab):
    """Each pair has its own coefficient by the mean of both; the manifest reads it back."""
    scenario = lab.scene(lab.ground(), lab.ball("one", (0.0, 0.0, 0.05)), lab.ball("two", (0.1, 0.0, 0.05)))
    floor, one, two = scenario.bodies
    table = (
        PairCoefficients("wood", "wood", 0.0, 0.5),
        PairCoefficients("wood", "metal", 0.0, 0.4),
        PairCoefficients("metal", "metal", 0.0, 0.3),
    )
    mixed = replace(scenario, bodies=(floor, replace(one, material="metal"), two), coefficients=table)
    found = {
        tuple(sorted((a, b))): group["friction"]
        for group in run_of(mixed, name, "steel").recording.facts["pairs"]
        for a in group["bodies_a"]
        for b in group["bodies_b"]
        if a != b
    }
    assert found == pytest.approx({("ground", "one"): 0.4, ("ground", "two"): 0.5, ("one", "two"): 0.4})


@pytest.mark.parametrize(("name", "profile", "rises"), [
    needed("physx", "default", False), needed("physx", "recommended", True),
])  # fmt: skip
def test_physx_bounces_from_its_threshold_on(name, profile, rises, lab):
    """A ball with e = 1 that falls 0.1 m meets the ground at 1.4 m/s: below 2 m/s, above 0.2 m/s."""
    scenario = lab.scene(lab.ground(), lab.ball("ball", (0.0, 0.0, 0.15)), e=1.0, duration=0.3)
    height = run_of(scenario, name, profile).recording.position[:, 1, 2]
    assert (height[-1] > 0.1) == rises
