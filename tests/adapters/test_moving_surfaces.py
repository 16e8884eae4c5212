"""Moving surfaces: Galilei's principle, orders of accuracy, and every engine by its own means."""

from dataclasses import replace

import numpy as np
import pytest

from touchstone.adapters.contract import Settings, State, Unsupported
from touchstone.adapters.divergence import Watch
from touchstone.adapters.motion_bounds import planned
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import profiles_of
from touchstone.scenarios.avatar.tracking import keyframed
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.random_scenes import kind_of, random_scene
from touchstone.scenarios.relations.changes import carried, with_hulls
from touchstone.scenarios.scenario import GRAVITY, Body, Box, Piece, Scenario, Sphere, Tracker
from touchstone.scenarios.solids import block
from touchstone.scenarios.transforms import mirrored, perturbed

SPEED = (1.0, 0.0, 0.0)
HALF = (4.0, 1.0, 0.05)
BELOW = (0.0, 0.0, -0.05)
ENGINES = ("reference", "mujoco", "bullet", "dart")
CARRIED_ERROR = {"reference": 1e-6, "mujoco": 5e-3, "bullet": 5e-3, "dart": 5e-3}
"""Distance of a load from its closed form [m]: steps of first order, and soft friction."""


def belt(kind: str = "fixed", *pieces: Piece, **motion: object) -> Body:
    """A belt of 8 by 2 m whose upper face is z = 0."""
    place = BELOW if kind == "fixed" else (0.0, 0.0, 0.0)
    return Body("belt", kind, "wood", (Piece("belt", Box(HALF), **motion), *pieces), position=place)


def moving(speed: float) -> Tracker:
    """Path along x at a constant speed [m/s]; its keyframes begin and end outside the scene."""
    times = np.arange(-60, 181) / 60
    return keyframed("belt", times, [(speed * t, 0.0, -0.05) for t in times], interpolation="pchip")


def loads(x: float = 0.0) -> tuple[Body, ...]:
    """A tower of two that is set down, and a box that slides across; all move at x [m/s] besides."""
    half, top = (0.1, 0.1, 0.05), (0.08, 0.08, 0.05)
    return (
        block("load", "wood", half, 1.0, (-1.0, 0.0, 0.05), velocity=(x, 0.0, 0.0)),
        block("top", "wood", top, 0.5, (-1.0, 0.0, 0.15), velocity=(x, 0.0, 0.0)),
        block("across", "wood", half, 1.0, (-1.0, 0.5, 0.05), velocity=(x, -0.4, 0.0)),
    )


def played(registry, scene: Scenario, engine: str = "reference", profile: str = "balanced"):
    """Recording by an engine at its own step, or at the frame's."""
    steps = profiles_of(engine)
    chosen = profile if engine == "reference" else next(iter(steps))
    dt = 1 / scene.frame_rate if engine == "reference" else steps[chosen]
    return record(registry.engine(engine), scene, Settings(chosen, dt))


@pytest.mark.parametrize("profile", ["balanced", "accurate"])
def test_galilei(registry, lab, profile):
    """A belt carries as a platform that moves uniformly, and as a floor at rest that loads slide over."""
    on_belt = lab.scene(belt(surface_velocity=SPEED), *loads(), mu=0.5)
    on_platform = lab.scene(belt("prescribed"), *loads(), mu=0.5, trackers=(moving(1.0),))
    on_floor = lab.scene(belt(), *loads(-1.0), mu=0.5)
    one, two, three = (played(registry, s, profile=profile) for s in (on_belt, on_platform, on_floor))
    assert np.abs(one.position[:, 1:] - two.position[:, 1:]).max() < 1e-6
    assert (
        np.abs(one.position[:, 1:] - three.position[:, 1:] - np.outer(one.time, SPEED)[:, None]).max() < 1e-9
    )


@pytest.mark.parametrize("profile", ["balanced", "accurate"])
@pytest.mark.parametrize("name", ["ellipsoid_rocks", "bowl", "prism_rolls", "sliders"])
def test_curved_contacts_on_a_platform(registry, name, profile):
    """What rolls, rocks and tips on a uniformly moving platform moves as on a floor at rest; on one that
    accelerates, as in the gravity that this is equal to."""
    scene = replace(catalogue()[name], duration=0.5, truths=(), published=(), forces=())
    free = [k for k, body in enumerate(scene.bodies) if body.kind == "simulated"]
    one = played(registry, scene, profile=profile)
    for speed, push in ((SPEED, (0.0, 0.0, 0.0)), ((0.0, 0.0, 0.0), (0.0, 0.0, 0.8))):
        two = played(registry, carried(scene, speed, push), profile=profile)
        way = np.outer(one.time, speed) + np.outer(one.time**2 / 2, push)
        assert np.abs(two.position - way[:, None] - one.position)[:, free].max() < 1e-7


def test_random_scenes_on_a_platform(registry):
    """Of fourteen drops, bridges and spinning bodies on a moving platform, all but one stay within what their
    own sensitivity makes of the distance at which impacts are found; in one, a graze may become a miss."""
    seeds = [seed for seed in range(5003, 5036) if kind_of(seed) in ("drop", "bridge", "spin")][:14]
    beyond = []
    for seed in seeds:
        scene = random_scene(seed)
        one = played(registry, scene)
        two = played(registry, carried(scene, SPEED))
        near = played(registry, perturbed(scene, 1e-10, 0))
        free = [k for k, body in enumerate(scene.bodies) if body.kind == "simulated"]
        apart = np.abs(two.position - np.outer(one.time, SPEED)[:, None] - one.position)[:, free].max()
        growth = np.abs(near.position - one.position).max() / 1e-10
        beyond += [seed] if apart >= 1e-6 * max(1.0, growth) else []
    assert len(seeds) == 14
    assert len(beyond) <= 1


def test_prescribed_bodies_may_overlap(registry):
    """Overlap removal leaves two prescribed bodies that overlap on their paths."""
    scene = carried(random_scene(5009), SPEED)
    seen = played(registry, scene)
    assert sum(body.kind == "prescribed" for body in scene.bodies) == 2
    assert (
        np.abs(seen.position[-1, 0] - seen.position[0, 0] - np.multiply(SPEED, seen.time[-1])).max() < 1e-12
    )


def test_a_fixed_turntable(registry):
    """A ball on a plate whose surface turns circles as on a plate that turns, to second order."""
    known = catalogue()["turntable"]
    plate = known.bodies[0].pieces[0]
    fixed = Body("plate", "fixed", "wood", (replace(plate, surface_angular_velocity=(0.0, 0.0, 2.0)),))
    errors = []
    for rate in (60, 120):
        scene = replace(known, bodies=(fixed, known.bodies[1]), trackers=(), truths=(), frame_rate=rate)
        seen = played(registry, scene)
        truth = motion(known, known.truths[0], seen.time)
        errors.append(np.abs(seen.position[:, 1] - truth.position).max())
    assert errors[0] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)


def test_a_friction_oscillator(registry, lab):
    """A plank on two rollers that turn towards each other swings as a pendulum (Timoshenko), to second order.

    With the rollers at -a and a, the height h of the centre of mass and the load N on each,
    N_1 - N_2 = -m g x / (a - mu h), and x'' = mu (N_1 - N_2) / m.
    """
    radius, a, h, mu, start = 0.1, 0.5, 0.02, 0.3, 0.2

    def roller(name: str, x: float, rate: float) -> Body:
        piece = Piece(name, Sphere(radius), surface_angular_velocity=(0.0, rate, 0.0))
        return Body(name, "fixed", "wood", (piece,), position=(x, 0.0, -radius))

    plank = block("plank", "wood", (1.2, 0.2, h), 2.0, (start, 0.0, h))
    rollers, errors = (roller("left", -a, 15.0), roller("right", a, -15.0)), []
    for rate in (60, 120):
        seen = played(registry, lab.scene(*rollers, plank, mu=mu, duration=2.0, frame_rate=rate))
        swing = start * np.cos(np.sqrt(mu * GRAVITY / (a - mu * h)) * seen.time)
        errors.append(np.abs(seen.position[:, 2, 0] - swing).max())
    assert errors[0] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)


@pytest.mark.engines
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("turned", [False, True])
def test_a_belt_on_a_moving_platform(registry, lab, engine, turned):
    """Velocities of platform and surface add up, also where the piece is turned and a hull."""
    piece = Piece("belt", Box(HALF), surface_velocity=(0.5, 0.0, 0.0))
    if turned:  # a quarter about z
        quarter, along = (0.5**0.5, 0.0, 0.0, 0.5**0.5), (0.0, -0.5, 0.0)
        piece = Piece("belt", Box((1.0, 4.0, 0.05)), orientation=quarter, surface_velocity=along)
    deck = Body("belt", "prescribed", "wood", (piece,))
    scene = lab.scene(deck, loads()[0], mu=0.5, trackers=(moving(0.5),), duration=1.0)
    seen = played(registry, with_hulls(scene) if turned and engine != "bullet" else scene, engine)
    slid = 1.0 / (0.5 * GRAVITY)
    at = np.where(seen.time < slid, 0.25 * GRAVITY * seen.time**2, seen.time - slid / 2) - 1.0
    assert np.abs(seen.position[:, 1, 0] - at).max() < CARRIED_ERROR[engine]


def test_who_cannot_play_them_says_so(registry, lab):
    """Profile `paper` has no moving surfaces; Bullet and DART have one motion per body."""
    side = Piece("side", Box((0.1, 0.1, 0.1)), (0.0, 3.0, 0.0))
    scene = lab.scene(belt("fixed", side, surface_velocity=SPEED), *loads(), mu=0.5)
    with pytest.raises(Unsupported, match="paper has no moving surfaces"):
        registry.engine("reference").build(scene, Settings("paper", 1 / 60))
    for name in ("bullet", "dart"):
        with pytest.raises(Unsupported, match=f"{name}: the surfaces of the pieces of 'belt' move"):
            registry.engine(name).build(scene, Settings("recommended", 1 / 240))


def test_of_several_pieces_the_nearest_moves(registry, lab):
    """Contacts with one piece of a body do not feel the motion of another, in motion and in the log."""
    lane = Piece("lane", Box((4.0, 1.0, 0.05)), (0.0, 2.5, 0.0))
    box = block("beside", "wood", (0.1, 0.1, 0.05), 1.0, (-1.0, 2.5, 0.05))
    scene = lab.scene(belt("fixed", lane, surface_velocity=SPEED), loads()[0], box, mu=0.5)
    for engine in ("reference", "mujoco"):
        seen = played(registry, scene, engine)
        assert seen.linear_velocity[-1, 1:, 0] == pytest.approx([1.0, 0.0], abs=1e-6)
        rows = seen.contacts
        for load, speed in ((1, 1.0), (2, 0.0)):
            own = rows["velocity_a_after"][rows["body_b"] == load]
            assert own[-1] == pytest.approx((speed, 0.0, 0.0), abs=1e-12)


def test_the_watch_knows_that_belts_do_work(lab):
    """A load that a belt carries off has not diverged, and its plan does not bound it."""
    scene = lab.scene(belt(surface_velocity=SPEED), loads()[0], mu=0.5)
    low = planned(scene).bounds.low
    assert np.isinf(low[1]).all()
    assert not Watch(scene)._grown(_carried(scene), 1.0)


def _carried(scene: Scenario) -> State:
    state = State(scene)
    for name in ("position", "orientation", "linear_velocity", "angular_velocity"):
        getattr(state, name)[:] = [getattr(body, name) for body in scene.bodies]
    state.linear_velocity[1] = SPEED
    return state


def test_the_mirror_image_moves_back(registry, lab):
    """The mirror image of a scene with a belt and a roller has the mirrored motion."""
    scene = lab.scene(belt(surface_velocity=SPEED, surface_angular_velocity=(0, 0, 0.3)), *loads(), mu=0.5)
    one, two = played(registry, scene), played(registry, mirrored(scene))
    # the forces at the corners of a box that turns are not unique
    assert np.abs(one.position * (-1, 1, 1) - two.position).max() < 1e-4
