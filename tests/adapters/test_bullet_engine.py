"""The Bullet adapter: shapes, coefficients, contacts, mass properties; its profile `maximal`."""

from dataclasses import replace

import numpy as np
import pytest
from engine_states import last

from touchstone.adapters.contract import Settings, Unsupported
from touchstone.adapters.recorder import record
from touchstone.scenarios import scenario as s
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Scenario
from touchstone.scenarios.solids import hull

pybullet = pytest.importorskip("pybullet", reason="pybullet is not installed")
from touchstone.adapters.engines.bullet.engine import BulletEngine  # noqa: E402

DT, G = 1 / 240, 9.81
RECOMMENDED = Settings("recommended", DT)
MARGIN = 0.001
"""What Bullet adds outside a hull [m]."""
CORNER = 1e-5
"""Bullet rounds hull corners to about 1e-4 of a size of 0.1 m [m]."""
TENSOR = ((2.0e-4, 3.0e-5, -2.0e-5), (3.0e-5, 3.0e-4, 4.0e-5), (-2.0e-5, 4.0e-5, 2.5e-4))
"""An inertia with no axis of the body as principal axis [kg m^2]."""
CUBE = s.Hull(tuple((x, y, z) for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-0.05, 0.05)))
FLOOR = s.Body("floor", "fixed", "a", (s.Piece("slab", s.Box((1.0, 1.0, 0.1)), position=(0.0, 0.0, -0.1)),))


def diagonal(moment):
    return ((moment, 0.0, 0.0), (0.0, moment, 0.0), (0.0, 0.0, moment))


def mover(shape, name="mover", **changes):
    """A simulated body of one piece at its origin."""
    given = {"mass": 0.2, "inertia": diagonal(4e-4)} | changes
    pieces = given.pop("pieces", (s.Piece("piece", shape),))
    return s.Body(name, "simulated", given.pop("material", "a"), pieces, **given)


def scene(*bodies, coefficients=((0.0, 0.5),), **changes):
    """A scenario of one second; coefficients of the material pairs aa, ab, bb."""
    names = (("a", "a"), ("a", "b"), ("b", "b"))
    pairs = tuple(s.PairCoefficients(*pair, *values) for pair, values in zip(names, coefficients))
    return s.Scenario("test", "a test", (), bodies, 1.0, pairs, **changes)


def build(scenario: Scenario, profile: str = "recommended"):
    """A world at 240 steps a second."""
    return BulletEngine().build(scenario, Settings(profile, DT))


def test_unsupported_scenes_are_named():
    """Pairs without factors and ellipsoids raise Unsupported and name the bodies."""
    bodies = [mover(s.Sphere(0.1), name, material=m) for name, m in zip("pqrs", "aabb")]
    with pytest.raises(Unsupported, match=r"bullet: no restitution per body .*r-s"):
        build(scene(*bodies, coefficients=((0.5, 0.5), (0.9, 0.5), (0.0, 0.5))))
    with pytest.raises(Unsupported, match=r"bullet: .*mover"):
        build(scene(mover(s.Ellipsoid((0.1, 0.2, 0.3)))))
    with pytest.raises(Unsupported, match=r"bullet: friction must be 0 or up to 10, found 12 .*floor-mover"):
        build(scene(FLOOR, mover(s.Sphere(0.1)), coefficients=((0.5, 12.0),)))
    with pytest.raises(Unsupported, match="bullet: no profile 'paper'; valid: recommended, equal-step"):
        build(scene(FLOOR), "paper")


def test_accurate_contacts_tell_no_force_of_an_earlier_step():
    """Bounces account for the change of momentum, to the last step: points left out have no force."""
    settings = Settings("accurate", BulletEngine.profiles["accurate"])
    ball = mover(s.Sphere(0.05), position=(0.0, 0.0, 0.1), linear_velocity=(0.5, 0.0, -1.0))
    scenario = scene(FLOOR, ball, coefficients=((0.5, 0.3),))
    final = record(BulletEngine(), scenario, settings)
    assert len(final.contacts) > 3
    gained = 0.2 * (final.linear_velocity[-1, 1] - [0.5, 0.0, -1.0 - G * 1.0])
    assert final.contacts["impulse"].sum(axis=0) == pytest.approx(gained, abs=1e-6 * 0.2 * G)


def test_a_body_of_many_pieces_rests_on_all_of_them():
    """Spheres, boxes and several turned hulls of one body, off its centre, all carry it level."""
    half = 0.5**0.5
    pieces = (
        s.Piece("hull 1", CUBE, position=(0.3, 0.0, 0.0), orientation=(half, 0.0, 0.0, half)),
        s.Piece("ball", s.Sphere(0.05 + MARGIN), position=(-0.3, 0.2, 0.0)),
        s.Piece("box", s.Box((0.05 + MARGIN, 0.04, 0.03)), (-0.3, -0.2, 0.0), (half, 0.0, half, 0.0)),
        s.Piece("hull 2", CUBE, position=(0.5, 0.0, 0.0)),
    )
    table = mover(None, pieces=pieces, position=(0.0, 0.0, 0.05 + MARGIN), inertia=diagonal(1e-2),
                  center_of_mass=(0.05, 0.0, 0.02))  # fmt: skip
    state = last(BulletEngine(), scene(table, FLOOR), RECOMMENDED, 240)
    rows = state.contacts[: state.contact_count]
    assert state.position[0] == pytest.approx([0.0, 0.0, 0.05 + MARGIN], abs=1e-4)  # erp and slop
    assert set(rows["body_a"]) == {0}
    assert -rows["impulse"][:, 2].sum() == pytest.approx(0.2 * G * DT, rel=1e-2)
    loaded = rows["position"][rows["impulse"][:, 2] < 0]
    assert loaded[:, 0].min() < -0.2 < 0.2 < loaded[:, 0].max()


@pytest.mark.parametrize("collide", [True, False])
def test_only_touching_pairs_collide(collide):
    """Links of one driven body meet only under self-collision and when not adjacent."""
    ball = (s.Piece("ball", s.Sphere(0.05)),)
    links = tuple(s.Body(name, "driven", "a", ball, mass=1.0, inertia=TENSOR) for name in "pqr")
    joints = tuple(s.Joint(b, a, b, (0.0, 0.0, 0.04), (0.0, 1.0, 0.0)) for a, b in ("pq", "qr"))
    still = ((0.0, 0.0, 1.0),) * 2, ((1.0, 0.0, 0.0, 0.0),) * 2, ((0.0, 0.0),) * 2
    tracker = s.Tracker("p", ("q", "r"), (0.0, 1.0), *still, hinge_frequency=1.0)
    effects = ("self_collision",) if collide else ()
    scenario = scene(*links, joints=joints, trackers=(tracker,), effects=effects)
    state = last(BulletEngine(), scenario, RECOMMENDED, 1)
    rows = state.contacts[: state.contact_count]
    assert set(zip(rows["body_a"], rows["body_b"])) == ({(0, 2)} if collide else set())


@pytest.mark.parametrize(("profile", "height"), [("default", MARGIN), ("recommended", 0), ("accurate", 0)])
def test_a_hull_rests_on_its_surface(profile, height):
    """A hull hovers by the margin by default alone."""
    scenario = scene(FLOOR, mover(CUBE, position=(0.0, 0.0, 0.05 + height)))
    dt = BulletEngine.profiles[profile]
    final = record(BulletEngine(), scenario, Settings(profile, dt)).position[-1, 1, 2]
    assert final == pytest.approx(0.05 + height, abs=2 * CORNER)  # contactSlop and corners: 1e-5 m each


@pytest.mark.parametrize("profile", ["recommended", "maximal"])
@pytest.mark.parametrize(("shape", "count"), [(s.Box((0.05, 0.05, 0.05)), 20), (CUBE, 110)])
def test_fixed_bodies_have_all_their_pieces(shape, count, profile):
    """A ball rests on the last of many pieces: Bullet drops the shapes of a compound beyond 16, and makes no
    multibody of so many links."""
    places = [(0.2 * k, 0.0, -0.05) for k in range(count)]
    row = s.Body("row", "fixed", "a", tuple(s.Piece(f"p{k}", shape, at) for k, at in enumerate(places)))
    ball = mover(s.Sphere(0.05), position=(places[-1][0], 0.0, 0.05))
    recording = record(BulletEngine(), scene(row, ball), Settings(profile, DT))
    assert recording.position[-1, 1, 2] == pytest.approx(0.05, abs=2 * MARGIN)


RIGID = "bodies in maximal coordinates"
CORNERS = ((0.1, 0.1, 0.1), (0.1, -0.1, -0.1), (-0.1, 0.1, -0.1), (-0.1, -0.1, 0.1))


def end(scenario: Scenario, profile: str, steps: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Positions and orientations after some steps, and the number of contact points."""
    state = last(BulletEngine(), scenario, Settings(profile, 1 / 240), steps)
    return state.position.copy(), state.orientation.copy(), state.contact_count


@pytest.mark.parametrize(("name", "steps"), [("collide_slips", 120), ("slip", 240), ("stack", 120)])
def test_both_representations_agree(name: str, steps: int) -> None:
    """Play collisions, rolling and resting faces as `recommended` does: equal contacts, 0.1 mm."""
    scenario = catalogue()[name]
    reduced, maximal = (end(scenario, profile, steps) for profile in ("recommended", "maximal"))
    assert reduced[2] == maximal[2]
    np.testing.assert_allclose(reduced[0], maximal[0], atol=1e-4)
    np.testing.assert_allclose(np.abs((reduced[1] * maximal[1]).sum(axis=1)), 1.0, atol=1e-4)


def test_friction_along_a_diagonal_differs() -> None:
    """A cube that slides at 45 degrees stops earlier as a rigid body: why both are profiles."""
    scenario = catalogue()["slide"]
    cube = scenario.body_index("box_45")
    way = [
        np.linalg.norm(end(scenario, profile, 480)[0][cube] - scenario.bodies[cube].position)
        for profile in ("recommended", "maximal")
    ]
    assert way[1] < 0.97 * way[0]


def test_mass_properties_are_ours() -> None:
    """Read back mass and inertia of rigid bodies as the scenario gives them."""
    scenario = catalogue()["stack"]
    reported = build(scenario, "maximal").describe()
    assert reported.settings[RIGID] == len(scenario.bodies)
    for body in scenario.bodies:
        if body.kind == "simulated":
            assert reported.bodies[body.name].mass == body.mass
            np.testing.assert_allclose(reported.bodies[body.name].inertia, body.inertia, rtol=1e-6)
    assert reported.pieces == {body.name: len(body.pieces) for body in scenario.bodies}


def test_other_bodies_stay_multibodies() -> None:
    """Keep hulls, driven links and inertias that are not the shape's in reduced coordinates."""
    scenario = catalogue()["stack"]
    floor, one, two, *_ = scenario.bodies
    odd = replace(one, inertia=tuple(tuple(2 * x for x in row) for row in one.inertia))
    pebble = hull("pebble", one.material, CORNERS, 1.0, (5.0, 0.0, 5.0))
    made = scenario.reduced(bodies=(floor, odd, two, pebble), truths=(), expectations=())
    reported = build(made, "maximal").describe()
    assert reported.settings[RIGID] == 2  # the floor and the box
    np.testing.assert_allclose(reported.bodies[odd.name].inertia, odd.inertia, rtol=1e-6)
    snip = build(catalogue()["ball_snip"], "maximal").describe()
    assert 0 < snip.settings[RIGID] < len(catalogue()["ball_snip"].bodies)


def test_friction_anchors_hold_boxes_and_hulls() -> None:
    """An arch stands with anchors, of which it has one per stone, and slides apart without."""
    assert _way_in_second_half("arch_stands", "recommended") < 1e-4
    assert _way_in_second_half("arch_stands", "recommended", "frictionAnchor=off") > 5e-4


def _way_in_second_half(name: str, profile: str, *changes: str) -> float:
    """Largest way of a body in the second half of a scene [m]."""
    place = record(BulletEngine(), catalogue()[name], Settings(profile, DT, changes)).position
    return float(np.linalg.norm(place[-1] - place[len(place) // 2], axis=1).max())


@pytest.mark.parametrize(
    ("name", "profile", "count"),
    [
        ("stack", "recommended", 5),
        ("stack", "equal-step", 5),
        ("stack", "default", 0),
        ("slip", "recommended", 0),  # balls roll
        ("belt", "recommended", 0),  # what lies on a belt is put back with it
    ],
)
def test_which_bodies_have_friction_anchors(name: str, profile: str, count: int) -> None:
    """Anchors of points that stick would hold what rolls, and what a moving surface carries."""
    world = build(catalogue()[name], profile)
    assert world.describe().settings["bodies with friction anchors"] == count
    world.close()
