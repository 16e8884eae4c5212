"""Every engine of the registry speaks our conventions and simulates the scenario it was given."""

from dataclasses import asdict

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import State, Unsupported
from touchstone.adapters.motion_bounds import planned
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import ENGINES
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import UNMOVED, Body, Box, Capsule, Cone, Ellipsoid, Hull, Piece, Sphere
from touchstone.scenarios.solids import box_inertia, sphere_inertia

DEPTH = 5e-4
"""Overlap at the start [m]: within every engine's tolerance for it."""
SPEED = 1.0
"""Approach speed [m/s]."""
TURN = Rotation.from_rotvec([0.3, -0.5, 0.4])
"""No axis of the box is one of the world."""
N = TURN.apply([0.0, 0.0, 1.0])
"""From the box to what meets its top."""
CUBE = Hull(tuple((x, y, z) for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-0.05, 0.05)))
SLACK = 2e-3
"""What a distance may be off [m]: Bullet's margin of 1 mm, and the motion up to the moment of impact."""
MASSES = {
    # relative
    "reference": 0.0,  # the scenario's numbers are its arrays
    "dart": 1e-12,  # rounding of products
    "bullet": 1e-12,  # principal axes and back
    "mujoco": 1e-12,  # the same
}
COEFFICIENTS = {"reference": 0.0, "dart": 1e-12, "bullet": 1e-12, "mujoco": 1e-12}
"""Relative; Bullet's are products of exponentials of solved logarithms."""


def simulated(name, shape, mass, inertia, position, **fields):
    turn = tuple(TURN.as_quat(scalar_first=True).tolist())
    piece = (Piece(name, shape),)
    fields |= {"mass": mass, "inertia": inertia, "position": tuple(position), "orientation": turn}
    return Body(name, "simulated", "wood", piece, **fields)


def meeting(lab, shape, box_first):
    """A ball or cube that presses with SPEED into the top of a heavier free box, without gravity."""
    half = (0.2, 0.3, 0.1)
    box = simulated("box", Box(half), 3.0, box_inertia(3.0, half), np.zeros(3))
    place = (half[2] + 0.05 - DEPTH) * N
    velocity = tuple((-SPEED * N).tolist())
    small = simulated("small", shape, 1.0, sphere_inertia(1.0, 0.05), place, linear_velocity=velocity)
    bodies = (box, small) if box_first else (small, box)
    return lab.scene(*bodies, mu=0.1, effects=("restitution", "friction"), duration=2 / 60)


@pytest.mark.parametrize("box_first", [True, False], ids=["box first", "box last"])
@pytest.mark.parametrize(
    "shape", [Sphere(0.05), CUBE, Capsule(0.03, 0.02)], ids=["sphere", "hull", "capsule on end"]
)
@pytest.mark.parametrize("name", ENGINES)
def test_a_touching_pair(registry, lab, name, shape, box_first):
    """Normal from A to B, A before B, overlap negative, and B gains the impulse that A loses."""
    scenario, settings = meeting(lab, shape, box_first), registry.settings(name)
    world = registry.engine(name).build(scenario, settings)
    before, after = State(scenario), State(scenario)
    world.read(before)
    world.drive(0)
    world.step()
    world.read(after)
    rows = after.contacts[: after.contact_count]
    assert len(rows) > 0
    assert set(zip(rows["body_a"], rows["body_b"])) == {(0, 1)}
    normal = N if box_first else -N
    # hulls: Bullet keeps corners to 1e-5 m of 0.1 m
    assert rows["normal"] == pytest.approx(np.tile(normal, (len(rows), 1)), abs=1e-3)
    assert rows["distance"].min() < 1e-6
    assert np.abs(rows["distance"]).max() < SLACK
    pressed = 0.1 * N
    heights = (rows["position"] - pressed) @ N
    assert np.abs(heights).max() < SLACK
    total = rows["impulse"].sum(axis=0)
    masses = np.array([body.mass for body in scenario.bodies])
    gained = masses[:, None] * (after.linear_velocity - before.linear_velocity)
    # what is left of a solver's tolerance, of an impulse of 0.75 N s
    assert gained[1] == pytest.approx(total, abs=1e-5)
    assert gained[0] == pytest.approx(-total, abs=1e-5)
    # e = 0 in one step, soft contacts take several: somewhere between nothing and a full reversal
    assert 0.01 < total @ normal < 2 * 0.75 * SPEED
    # MuJoCo's and Bullet's points on a face need not share the load: some impulse is spent on turning
    assert np.linalg.norm(total - (total @ normal) * normal) <= 0.1 * (total @ normal) + 1e-5
    world.close()


@pytest.mark.parametrize("name", ENGINES)
def test_gravity_is_the_scenarios(registry, lab, name):
    """A free body falls by g t, whatever the direction of gravity; with the effect off it rests."""
    for effects, g in (((), (0.0, 0.0, 0.0)), (("gravity",), (1.0, -2.0, -3.0))):
        scenario = lab.scene(lab.ball(), effects=effects, gravity=(1.0, -2.0, -3.0), duration=0.25)
        kept = record(registry.engine(name), scenario, registry.settings(name))
        truth = np.outer(kept.time, g)
        assert kept.linear_velocity[:, 0] == pytest.approx(truth, abs=1e-9)  # rounding of 255 steps


LACKS = {
    ("bullet", Ellipsoid): "makes no ellipsoids",
    ("bullet", Cone): "makes no cones",
    ("mujoco", Cone): "no shape Cone",
}
"""Shapes that engines refuse, and what they say."""


@pytest.mark.parametrize(
    "scene",
    [
        pytest.param(scene.name, marks=pytest.mark.slow) if "heap" in scene.tags else scene.name
        for scene in catalogue().values()
    ],
)
@pytest.mark.parametrize("name", ENGINES)
def test_the_manifest_is_the_scenario(registry, name, scene):
    """Masses, centres, inertias and pair coefficients, read back from the engine, are those of the scene."""
    scenario, settings = catalogue()[scene], registry.settings(name)
    shapes = {type(piece.shape) for body in scenario.bodies for piece in body.pieces}
    for reason in (LACKS[name, shape] for shape in shapes if (name, shape) in LACKS):
        with pytest.raises(Unsupported, match=reason):
            registry.engine(name).build(scenario, settings)
        return
    world = registry.engine(name).build(scenario, settings)
    facts = asdict(world.describe())
    world.close()
    assert (facts["engine"], facts["profile"], facts["dt"]) == (name, settings.profile, settings.dt)
    moving = [body for body in scenario.bodies if body.kind not in UNMOVED]
    assert set(facts["bodies"]) >= {body.name for body in moving}
    for body in moving:
        read, slack = facts["bodies"][body.name], MASSES[name]
        assert read["mass"] == pytest.approx(body.mass, rel=slack, abs=0)
        # relative to the hand's size and inertia
        assert read["center_of_mass"] == pytest.approx(body.center_of_mass, abs=0.1 * slack)
        largest = np.abs(body.inertia).max()
        assert np.array(read["inertia"]) == pytest.approx(np.array(body.inertia), abs=largest * slack)
    pairs = {
        (scenario.body_index(p["body_a"]), scenario.body_index(p["body_b"])): (
            p["restitution"],
            p["friction"],
        )
        for p in facts["pairs"]
    }
    # what the plan leaves without pieces is in no pair
    assert set(planned(scenario).pairs) <= set(pairs) <= set(scenario.touching_pairs())
    for pair, read in pairs.items():
        assert read == pytest.approx(scenario.pair_coefficients(*pair), rel=COEFFICIENTS[name], abs=0)


@pytest.mark.parametrize("name", ENGINES)
def test_worlds_start_as_the_scenario_says(registry, name):
    """Before the first step bodies are where the scenario puts them, links where their tracker does."""
    scenario = catalogue()["ball_snip"]
    first = registry.played("ball_snip", name)
    for k, body in enumerate(scenario.bodies):
        if body.kind != "driven":
            # rounding of poses turned forth and back
            assert first.position[0, k] == pytest.approx(body.position, abs=1e-12)
            assert abs(first.orientation[0, k] @ body.orientation) == pytest.approx(1.0, abs=1e-12)
    tracker = scenario.trackers[0]
    assert first.position[0, scenario.body_index("palm")] == pytest.approx(tracker.positions[0], abs=1e-9)
    assert first.joint_angle[0] == pytest.approx(tracker.angles[0], abs=1e-9)
    assert len(first.time) == scenario.frame_count + 1


@pytest.mark.parametrize("name", ENGINES)
def test_pairs_that_may_not_touch_never_do(registry, name):
    """No recorded contact is between links of one hand or between fixed bodies, and all are in time order."""
    scenario, rows = catalogue()["ball_snip"], registry.played("ball_snip", name).contacts
    assert set(zip(rows["body_a"], rows["body_b"])) <= set(scenario.touching_pairs())
    assert (rows["body_a"] < rows["body_b"]).all()
    assert (np.diff(rows["time"]) >= 0).all()
    assert np.linalg.norm(rows["normal"], axis=1) == pytest.approx(1.0, abs=1e-9)
    pushing = np.einsum("ij,ij->i", rows["impulse"], rows["normal"])
    assert pushing.min() >= -1e-9  # contacts push; rounding of a solver
