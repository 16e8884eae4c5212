"""Newton, Rapier, PhysX and MuJoCo Warp in their environments: conformance, closed forms, what they report
and refuse. Without its environment (`touchstone env add newton`) an engine is skipped."""

import os
import re
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from plain_steps import PLAIN, cost
from swing_scene import swing

from touchstone.adapters.conformance.check import check
from touchstone.adapters.contract import Settings
from touchstone.adapters.recording import load as loaded
from touchstone.adapters.registry import (
    DEFAULT_ENGINES,
    installed,
    missing_reason,
    packages_of,
    profiles_of,
    registered,
    settings_of,
)
from touchstone.adapters.workers.children import Children, Job
from touchstone.adapters.workers.play import play
from touchstone.adapters.workers.pool import EngineProcess
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Capsule, Hull, PairCoefficients

PROFILES = {
    "rapier": ("recommended", "default", "accurate"),
    "physx": ("recommended", "default", "pgs"),
    "newton": ("xpbd", "mujoco", "mujoco-elliptic", "steel", "kamino"),
    "mujoco_warp": ("recommended", "equal-step", "default", "accurate", "sleeping"),
}
COMPILED = ("newton", "mujoco_warp")
"""Engines that compile their kernels."""
COMPILING = pytest.mark.timeout(3600)
"""Limit on their tests on a machine that others use too; children that hang end by themselves."""
FINDINGS = Path(__file__).parents[2] / "docs" / "findings"
PROGRAMS = {"rapier": 3, "physx": 3, "newton": 5, "mujoco_warp": 3, "drake": 3}
"""Programs in the findings of each engine, at least."""
COST = 1.1
"""Largest time of an adapter's step over that of a plain one [1]."""
BACKEND = 1e-3
"""Distance of MuJoCo Warp from MuJoCo in half a second of `stack` [m]; 0.19 mm measured."""
SPEED, MU, G, HALF = 3.0, 0.5, 9.81, 0.1


def needed(name, *values, slow=False):
    """Values of a parametrised test, which is skipped where the engine is not installed."""
    skip = pytest.mark.skipif(not installed(name), reason=f"{name}: {missing_reason(name)}")
    marks = (skip, pytest.mark.engines, *((pytest.mark.slow, COMPILING) if slow else ()))
    return pytest.param(name, *values, marks=marks, id=" ".join((name, *map(str, values))))


EACH = [
    needed(name, profile, slow=name in COMPILED)
    for name, profiles in PROFILES.items()
    for profile in profiles
    if name != "mujoco_warp"
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


@pytest.fixture(scope="module")
def children():
    """One process for each engine plays all scenes of this file: some take seconds to import."""
    with Children(per_engine=True) as kept:
        yield kept


@pytest.fixture
def run_of(children):
    """Play a scene to its end on a profile, at its step or another."""

    def run_of(scenario, name, profile="recommended", dt=None):
        run = play(scenario, [(name, profile)], dt=dt, children=children)[name, profile]
        assert run.status == "done", run.reason
        return run

    return run_of


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
    ("name", "profile", "faults"),
    [
        needed("mujoco_warp", "recommended", "coefficients", slow=True),
        *(needed("mujoco_warp", profile, "", slow=True) for profile in ("equal-step", "default", "accurate")),
    ],
)
def test_the_adapter_of_mujoco_warp_has_the_faults_of_mujoco(name, profile, faults):
    """Checks of conformance find what they find on MuJoCo, whose cubes hop, and nothing else."""
    found, expected = (
        [report.check for report in check(engine, profile) if report.faults] for engine in (name, "mujoco")
    )
    assert found == expected == faults.split()


@pytest.mark.parametrize(
    ("name", "profile", "largest"),
    [
        *(needed("rapier", profile, 0.01) for profile in ("recommended", "default")),
        needed("rapier", "accurate", 0.07),  # it depends on the heading: docs/findings/rapier.md
        *(needed("physx", profile, 0.02) for profile in PROFILES["physx"]),
        *(needed("newton", p, 0.02, slow=True) for p in ("xpbd", "mujoco-elliptic", "steel", "kamino")),
    ],
)
def test_a_box_slides_as_far_as_coulomb_says(name, profile, largest, lab, box, run_of):
    """A box stops after v^2 / (2 mu g) straight ahead."""
    scenario = lab.scene(lab.ground(), box(linear_velocity=(SPEED, 0.0, 0.0)), mu=MU, duration=1.0)
    run = run_of(scenario, name, profile)
    assert run.recording.position[-1, 1, 0] == pytest.approx(SPEED**2 / (2 * MU * G), rel=largest)


@pytest.mark.parametrize(
    ("name", "profile"),
    [needed("rapier", "recommended"), needed("physx", "recommended"), needed("newton", "steel")],
)
def test_a_hull_rests_on_its_face(name, profile, lab, box, run_of):
    """A cube of eight vertices stays where a box does."""
    scenario = lab.scene(lab.ground(), box(), duration=0.2)
    ground, cube = scenario.bodies
    corners = tuple((x, y, z) for x in (-HALF, HALF) for y in (-HALF, HALF) for z in (-HALF, HALF))
    hull = replace(cube, pieces=(replace(cube.pieces[0], shape=Hull(corners)),))
    run = run_of(replace(scenario, bodies=(ground, hull)), name, profile)
    np.testing.assert_allclose(run.recording.position[-1, 1], cube.position, atol=1e-3)


@pytest.mark.parametrize("name", BOTH)
def test_a_capsule_stands_along_its_z_axis(name, lab, box, run_of):
    """Upright on a flat ground, its centre is half its length and a radius above it."""
    scenario = lab.scene(lab.ground(), box(), duration=0.2, mu=MU)
    ground, cube = scenario.bodies
    capsule = replace(
        cube, position=(0.0, 0.0, 0.35), pieces=(replace(cube.pieces[0], shape=Capsule(0.1, 0.25)),)
    )
    run = run_of(replace(scenario, bodies=(ground, capsule)), name)
    assert run.recording.position[-1, 1, 2] == pytest.approx(0.35, abs=2e-3)


CARRYING = [
    *(needed(name, "recommended") for name in ("rapier", "physx")),
    *(needed("newton", profile, slow=True) for profile in ("xpbd", "mujoco", "mujoco-elliptic", "steel")),
]


@pytest.mark.parametrize(("name", "profile"), CARRYING)
def test_a_prescribed_body_carries_another(name, profile, run_of):
    """A load on a platform that moves too gently for it to slip has its velocity, to a step."""
    run = run_of(catalogue()["platform_stick"], name, profile)
    names = [body.name for body in catalogue()["platform_stick"].bodies]
    load, platform = (run.recording.linear_velocity[:, names.index(one), 0] for one in ("load", "platform"))
    assert platform.max() > 1.0
    np.testing.assert_allclose(load, platform, atol=0.06)


@pytest.mark.parametrize("name", [*BOTH, needed("newton", slow=True)])
def test_a_posed_hand_pushes_a_ball(name, tmp_path, children):
    """Driven links are kinematic under the drive `posed`, and push what they meet."""
    profile, dt = next(iter(profiles_of(name).items()))
    settings = Settings(profile, dt, drive="posed")
    job = Job(name, catalogue()["ball_snip"], settings, tmp_path / "run.npz", tmp_path / "output.txt")
    (outcome,) = children.play([job], lambda label, frames: None)
    assert outcome.status == "done", outcome.reason
    assert np.linalg.norm(loaded(job.recording).linear_velocity[-1], axis=1).max() > 0.1


@pytest.mark.parametrize(
    ("name", "profile", "scene", "reason"),
    [
        needed("physx", "recommended", "cone_holds", "no shape Cone"),
        needed("mujoco_warp", "sleeping", "fall", "no sleeping on the CPU"),
        needed("newton", "kamino", "ball_snip", "Kamino's dense matrix has no room for the contacts"),
        needed("newton", "kamino", "platform_stick", "Kamino's PADMM does not move kinematic bodies"),
        needed("newton", "mujoco", "bounce_e1", "restitution must be 0 or up to 0.3, found 1 for the pairs"),
        needed("newton", "kamino", "fall", "Kamino steps no scene in which nothing can touch"),
    ],
)
def test_what_cannot_be_represented_is_refused(name, profile, scene, reason, children):
    """One line says what the adapter or the solver lacks."""
    run = play(catalogue()[scene], [(name, profile)], children=children)[name, profile]
    assert run.status == "skipped"
    assert run.reason.startswith(f"{name}: {reason}")


@pytest.mark.parametrize(
    ("name", "profile", "dt"),
    [
        *(needed("physx", profile, None) for profile in PROFILES["physx"]),
        needed("newton", "steel", 1 / 960, slow=True),  # at 1/240 s it creeps: newton.plates
        needed("newton", "kamino", None, slow=True),
    ],
)
def test_plates_hold_a_cube(name, profile, dt, run_of):
    """`grip`: friction of the plates carries the cube; each pair has its own."""
    scenario = catalogue()["grip"]
    run = run_of(scenario, name, profile, dt)
    height = run.recording.position[:, scenario.body_index("cube"), 2]
    assert height[-1] == pytest.approx(0.04, abs=1e-3)
    assert abs(height[-1] - height[120]) < 1e-4
    found = {round(group["friction"], 6) for group in run.recording.facts["pairs"]}
    assert found == {0.3, 0.7}


@pytest.mark.parametrize("name", [needed("rapier")])
def test_friction_impulses_of_rapier_balance_the_momentum(name, lab, box, run_of):
    """In `accurate`, the impulses of a sliding box are the change of its momentum, at an odd heading."""
    velocity = SPEED * np.array([np.cos(0.7), np.sin(0.7), 0.0])
    scenario = lab.scene(lab.ground(), box(linear_velocity=tuple(velocity)), mu=MU, duration=0.2)
    recording = run_of(scenario, name, "accurate").recording
    change = recording.linear_velocity[-1, 1] - velocity  # of 1 kg
    assert recording.contacts["body_b"].tolist() == [1] * len(recording.contacts)
    weight = np.array([0.0, 0.0, G * 0.2])
    np.testing.assert_allclose(recording.contacts["impulse"].sum(axis=0) - weight, change, atol=1e-4)


@pytest.mark.parametrize(
    ("name", "profile", "metal", "table", "expected"),
    [
        # where no mean fits, the product of both does; a mean of factors does
        needed("rapier", "recommended", ("one", "two"), (0.9, 0.09, 0.3), (0.09, 0.09, 0.3)),
        needed("newton", "steel", ("one",), (0.5, 0.4, 0.3), (0.4, 0.5, 0.4)),
    ],
)
def test_factors_of_bodies_give_each_pair_its_friction(name, profile, metal, table, expected, lab, run_of):
    """By the engine's rule, which the manifest reads back, and each pair's coefficient with it."""
    balls = lab.ball("one", (0.0, 0.0, 0.05)), lab.ball("two", (0.1, 0.0, 0.05))
    bodies = [replace(b, material="metal") if b.name in metal else b for b in (lab.ground(), *balls)]
    kinds = ("wood", "wood"), ("wood", "metal"), ("metal", "metal")
    coefficients = tuple(PairCoefficients(*pair, 0.0, mu) for pair, mu in zip(kinds, table))
    scenario = replace(lab.scene(*bodies[:1]), bodies=tuple(bodies), coefficients=coefficients)
    facts = run_of(scenario, name, profile).recording.facts
    if name == "rapier":
        assert facts["settings"]["friction_rule"] == "CoefficientCombineRule.MULTIPLY"
    found = {
        tuple(sorted((a, b))): group["friction"]
        for group in facts["pairs"]
        for a in group["bodies_a"]
        for b in group["bodies_b"]
        if a != b
    }
    pairs = ("ground", "one"), ("ground", "two"), ("one", "two")
    assert found == pytest.approx(dict(zip(pairs, expected)))


@pytest.mark.parametrize(("name", "profile", "rises"), [
    needed("physx", "default", False), needed("physx", "recommended", True),
])  # fmt: skip
def test_physx_bounces_from_its_threshold_on(name, profile, rises, lab, run_of):
    """A ball with e = 1 that falls 0.1 m meets the ground at 1.4 m/s: below 2 m/s, above 0.2 m/s."""
    scenario = lab.scene(lab.ground(), lab.ball("ball", (0.0, 0.0, 0.15)), e=1.0, duration=0.3)
    height = run_of(scenario, name, profile).recording.position[:, 1, 2]
    assert (height[-1] > 0.1) == rises


@pytest.mark.parametrize(("name", "profile"), CARRYING)
def test_hinges_follow_their_tracker(name, profile, run_of):
    """A hand whose index finger snaps has its other hinges where its glove has them, to what the snap moves
    them; at the end all are there, and links that may not touch do not."""
    scenario = catalogue()["ball_snip"]
    recording = run_of(scenario, name, profile).recording
    target = sample(scenario.trackers[0], recording.time).angle
    assert np.ptp(target[:, 3]) > 0.9
    np.testing.assert_allclose(recording.joint_angle[0], target[0], atol=1e-6)
    np.testing.assert_allclose(recording.joint_angle[:, 6:], target[:, 6:], atol=0.01)
    np.testing.assert_allclose(recording.joint_angle[-1], target[-1], atol=1e-3)
    limits = recording.facts["limits"]
    for hinge in scenario.joints:
        assert limits[hinge.name] == pytest.approx((hinge.lower, hinge.upper), abs=1e-6)
    links = set(scenario.links(scenario.trackers[0]))
    assert not any(links.issuperset(pair) for pair in recording.contacts[["body_a", "body_b"]].tolist())


@pytest.mark.parametrize(("name", "profile"), [needed("physx", p) for p in ("recommended", "pgs")])
def test_torques_of_hinges_account_for_the_energy(name, profile, run_of):
    """The work of torques read back is the kinetic energy of a finger that bends in the open, to 10 %: at
    1/120 s, the first step speeds it up by a tenth."""
    run = run_of(swing(), name, profile)
    half = len(run.recording.time) // 2
    link, recording = swing().bodies[1], run.recording
    speed, spin = recording.linear_velocity[half, 1], recording.angular_velocity[half, 1]
    energy = 0.5 * link.mass * speed @ speed + 0.5 * link.inertia[1][1] * spin @ spin
    assert recording.driver_work[half] == pytest.approx(energy, rel=0.1)


@pytest.mark.parametrize("name", [needed(name, slow=True) for name in PLAIN])
def test_a_step_of_the_adapter_costs_as_much_as_a_plain_one(name, tmp_path):
    """Drive and step of `stack` take at most a tenth longer than in a script without the adapter."""
    child = EngineProcess(cost, tmp_path / "output.txt")
    found = child.ask("play", SimpleNamespace(engine=registered(name)))
    child.stop()
    assert child.failure is None
    assert 0.5 < found < COST


@pytest.mark.parametrize("name", [needed("mujoco_warp", slow=True)])
def test_mujoco_warp_plays_the_model_of_mujoco(name):
    """In `stack` both are at the same place, not to the bit, and their contacts bear the weight."""
    scenario = catalogue()["stack"]
    runs = play(scenario, [(name, "recommended"), ("mujoco", "recommended")])
    one, other = (run.recording for run in runs.values())
    apart = np.abs(one.position[:30] - other.position[:30]).max()
    assert 0 < apart < BACKEND
    weight = sum(body.mass for body in scenario.bodies) * G
    for recording in (one, other):
        ground = recording.contacts[recording.contacts["body_a"] == 0]
        last = ground[ground["time"] > 0.5]["impulse"][:, 2].sum() / 0.5
        assert last == pytest.approx(weight, rel=0.01)


@pytest.mark.parametrize(
    ("name", "least"),
    [needed(name, least, slow=True) for name, least in PROGRAMS.items()],
)
def test_programs_of_findings_run(name, least):
    """Each finding's program runs with the engine alone, and prints figures."""
    programs = re.findall(r"```python\n(.*?)```", (FINDINGS / f"{name}.md").read_text("utf-8"), re.DOTALL)
    assert len(programs) >= least
    for program in programs:
        place = {**os.environ, "PYTHONPATH": str(packages_of(name) or "")}
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=place)
        assert done.returncode == 0, done.stderr
        assert re.search(r"\d\.\d", done.stdout)
