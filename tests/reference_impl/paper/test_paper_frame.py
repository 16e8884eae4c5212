"""The paper's own claims on its pipeline: who moves, in which order, how far, and what it misses."""

import ast
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.adapters.engines.reference.reference_world import translate
from touchstone.reference_impl.core.conventions import OVERLAP_TOLERANCE, SIMULATED
from touchstone.reference_impl.core.world import World
from touchstone.reference_impl.paper import frame
from touchstone.reference_impl.paper.overlap_avoidance import translate_out
from touchstone.scenarios.scenario import Scenario

RADIUS, GRAVITY = 0.05, 9.81
PACKAGE = Path(frame.__file__).parent


def build(scenario: Scenario) -> World:
    """A world ready for its first step in profile `paper`."""
    world = translate(scenario)
    world.state["dt"], world.state["gravity"] = 1 / 60, scenario.acting_gravity
    frame.prepare(*world)
    return world


def play(world: World, frames: int) -> list:
    """Step a world whose trackers rest; returns the collisions of all frames."""
    rows = []
    for _ in range(frames):
        frame.step(*world)
        rows += list(world.contacts[: int(world.state[0]["contact_count"])].copy())
    return rows


def simulated(world: World) -> np.ndarray:
    """The first simulated body."""
    return world.bodies[int(np.flatnonzero(world.bodies["kind"] == SIMULATED)[0])]


def driven_world(lab: SimpleNamespace, starts, *others, **options):
    """Driven balls of 0.4 kg at rest at `starts`, bodies 0, 1, ... of the scene, among others."""
    names = [f"driven_{k}" for k in range(len(starts))]
    trackers = tuple(lab.still(name, start) for name, start in zip(names, starts))
    balls = [replace(lab.ball(name, (0.0, 0.0, 0.0), mass=0.4), kind="driven") for name in names]
    return build(lab.scene(*balls, *others, trackers=trackers, **options))


def place(world, *positions) -> None:
    """Put driven balls and their trackers at these positions, at rest."""
    for driver, position in zip(world.drivers, positions):
        for field in ("position", "target_position", "old_target_position"):
            driver[field] = position
        driver["velocity"] = 0.0


def test_only_the_driven_object_leaves_a_fixed_one(lab: SimpleNamespace) -> None:
    """Push a driven ball out of the ground by its depth, in one round."""
    world = driven_world(lab, [(0.0, 0.0, 0.2)], lab.ground())
    place(world, (0.1, 0.2, 0.03))
    play(world, 1)
    np.testing.assert_allclose(world.drivers[0]["position"], (0.1, 0.2, RADIUS), atol=1e-12)
    assert lab.counters(world)["rounds"] == 1


def test_driven_objects_move_half_each(lab: SimpleNamespace) -> None:
    """Part two driven balls by half of their depth each."""
    world = driven_world(lab, [(-0.2, 0.0, 0.0), (0.2, 0.0, 0.0)])
    place(world, (-0.04, 0.0, 0.0), (0.04, 0.0, 0.0))
    play(world, 1)
    np.testing.assert_allclose(world.drivers["position"][:, 0], (-RADIUS, RADIUS), atol=1e-12)


def test_simulated_objects_move_half_each(lab: SimpleNamespace) -> None:
    """Part two simulated balls, light and heavy, by half of their depth each."""
    balls = (lab.ball("one", (-0.2, 0.0, 0.0), mass=0.01), lab.ball("two", (0.2, 0.0, 0.0)))
    world = build(lab.scene(*balls))
    for row, x in zip(world.bodies, (-0.04, 0.04)):
        row["position"] = row["center"] = (x, 0.0, 0.0)
    translate_out(world.of_stages(), SIMULATED)
    np.testing.assert_allclose(world.bodies["position"][:, 0], (-RADIUS, RADIUS), atol=1e-12)
    assert lab.counters(world)["rounds"] == 1


def test_the_driven_object_leaves_a_simulated_one(lab: SimpleNamespace) -> None:
    """Move the driven ball alone out of a simulated one."""
    world = driven_world(lab, [(-0.3, 0.0, 0.0)], lab.ball("ball", (0.0, 0.0, 0.0)), gravity=(0.0, 0.0, 0.0))
    place(world, (-0.08, 0.0, 0.0))
    before = simulated(world)["position"].copy()
    play(world, 1)
    np.testing.assert_allclose(world.drivers[0]["position"], (-0.1, 0.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(simulated(world)["position"], before, atol=1e-9)


def test_the_simulated_object_moves_where_the_driven_one_cannot(lab: SimpleNamespace) -> None:
    """Move a simulated ball away that stands in the last free state of a driven one held by two walls."""
    walls = [lab.block(f"wall_{s}", (0.5, 1.0, 1.0), (s * 0.55, 0.0, 0.0), kind="fixed") for s in (-1, 1)]
    ball = lab.ball("ball", (0.0, 0.09, 0.0))
    world = driven_world(lab, [(0.0, -0.5, 0.0)], *walls, ball, gravity=(0.0, 0.0, 0.0))
    for field in ("position", "target_position", "old_target_position", "free_position"):
        world.drivers[0][field] = (0.0, 0.0, 0.0)
    play(world, 1)
    gap = np.linalg.norm(simulated(world)["position"] - world.drivers[0]["position"]) - 2 * RADIUS
    assert gap > -2 * OVERLAP_TOLERANCE


def test_opposing_normals_need_the_interpolation(lab: SimpleNamespace) -> None:
    """Bring a driven ball that two walls overlap from both sides back towards where it came from (4b)."""
    walls = [lab.block(f"wall_{s}", (0.5, 1.0, 1.0), (s * 0.54, -1.0, 0.0), kind="fixed") for s in (-1, 1)]
    world = driven_world(lab, [(0.0, 0.2, 0.0)], *walls)
    play(world, 1)
    place(world, (0.0, -0.2, 0.0))
    play(world, 1)
    assert lab.counters(world)["way_back"] == 1
    # the ball touches the edges of both walls
    assert world.drivers[0]["position"][1] == pytest.approx(np.sqrt(RADIUS**2 - 0.04**2), abs=1e-4)


def test_a_ball_bounces_at_e(lab: SimpleNamespace) -> None:
    """Leave the ground at e times the speed of arrival (Eq. 8)."""
    e = 0.8
    world = build(lab.scene(lab.ball("ball", (0.0, 0.0, 0.55)), lab.ground(), e=e, mu=0.0))
    rows = play(world, 25)
    ball, sign = ("b", 1) if rows[0]["normal"][2] > 0 else ("a", -1)
    before, after = (sign * rows[0][f"velocity_{ball}_{when}"][2] for when in ("before", "after"))
    assert sign * after == pytest.approx(-e * sign * before, rel=1e-9)


def test_a_body_at_rest_stays(lab: SimpleNamespace) -> None:
    """Let gravity press a ball on the ground for ten seconds without a bounce."""
    world = build(lab.scene(lab.ball("ball", (0.0, 0.0, RADIUS)), lab.ground(), e=0.8, mu=0.3))
    play(world, 600)
    assert world.bodies[0]["position"][2] == pytest.approx(RADIUS, abs=2 * OVERLAP_TOLERANCE)
    assert np.abs(world.bodies[0]["velocity"]).max() < 1e-12


def test_eq_10_reverses_slow_sliding(lab: SimpleNamespace) -> None:
    """Apply mu j where less would stop the sliding: the ball goes back faster than it came."""
    ball = lab.ball("ball", (0.0, 0.0, RADIUS), linear_velocity=(1e-3, 0.0, 0.0))
    world = build(lab.scene(ball, lab.ground(), e=0.0, mu=0.3))
    play(world, 1)
    v = world.bodies[0]["velocity"][0]
    assert v == pytest.approx(1e-3 - 0.3 * GRAVITY / 60, rel=1e-9)


def test_discrete_tests_miss_a_thin_plate(lab: SimpleNamespace) -> None:
    """Pass a ball of 30 m/s through a plate of 1 mm: "it cannot be excluded that collisions are missed"."""
    plate = lab.block("plate", (0.4, 0.4, 5e-4), (0.0, 0.0, 0.0), kind="fixed")
    ball = lab.ball("ball", (0.0, 0.0, 0.2), linear_velocity=(0.0, 0.0, -30.0))
    world = build(lab.scene(ball, plate, gravity=(0.0, 0.0, 0.0)))
    play(world, 1)
    assert world.bodies["position"][:, 2].min() < -0.1


def test_a_free_spin_keeps_its_momentum(lab: SimpleNamespace) -> None:
    """Turn a box without torque for ten seconds: its angular momentum stays to rounding."""
    box = lab.block("box", (0.1, 0.2, 0.3), (0.0, 0.0, 0.0), angular_velocity=(0.1, 5.0, 0.1))
    world = build(lab.scene(box, gravity=(0.0, 0.0, 0.0)))

    def momentum():
        body = world.bodies[0]
        return body["rotation"] @ body["inertia"] @ body["rotation"].T @ body["omega"]

    before = momentum()
    play(world, 600)
    np.testing.assert_allclose(momentum(), before, rtol=1e-9, atol=1e-12)


def test_an_impulse_moves_the_whole_driven_object(lab: SimpleNamespace) -> None:
    """Keep the momentum of a ball that hits a driven one of Eq. 6's mass, which recoils."""
    ball = lab.ball("ball", (-0.2, 0.0, 0.0), linear_velocity=(8.0, 0.0, 0.0), mass=0.2)
    world = driven_world(lab, [(0.0, 0.0, 0.0)], ball, e=0.5, mu=0.0, gravity=(0.0, 0.0, 0.0))
    play(world, 1)
    momentum = 0.2 * simulated(world)["velocity"][0] + 0.4 * world.drivers[0]["velocity"][0]
    assert world.drivers[0]["velocity"][0] > 0
    assert momentum == pytest.approx(0.2 * 8.0, rel=1e-9)
    # Eq. 8 with the same mass
    left = simulated(world)["velocity"][0] - world.drivers[0]["velocity"][0]
    assert left == pytest.approx(-0.5 * 8.0, rel=1e-9)


@pytest.mark.parametrize("speeds", [(1.0, 3.0), (3.0, 1.0)])
def test_the_fastest_collision_comes_first(lab: SimpleNamespace, speeds: tuple[float, float]) -> None:
    """Hit a ball from both sides at once: the first impulse is that of the faster ball."""
    left, right = speeds
    balls = (
        lab.ball("left", (-2 * RADIUS, 0.0, 0.0), linear_velocity=(left, 0.0, 0.0)),
        lab.ball("middle", (0.0, 0.0, 0.0)),
        lab.ball("right", (2 * RADIUS, 0.0, 0.0), linear_velocity=(-right, 0.0, 0.0)),
    )
    rows = play(build(lab.scene(*balls, e=0.5, gravity=(0.0, 0.0, 0.0))), 1)
    assert (0 if left > right else 2) in (rows[0]["body_a"], rows[0]["body_b"])


def test_the_package_is_read_in_an_hour() -> None:
    """At most 1,400 lines."""
    assert sum(len(path.read_text().splitlines()) for path in PACKAGE.glob("*.py")) <= 1400


def test_every_equation_stands_once() -> None:
    """Begin the docstring of one function with each equation's number, or with those of two."""
    found = []
    for path in sorted(PACKAGE.glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            text = ast.get_docstring(node) if isinstance(node, ast.FunctionDef) else None
            if text and (match := re.match(r"Eqs?\. (\d+)(?: and (\d+))?[:,]", text)):
                found += [int(number) for number in match.groups() if number]
    assert sorted(found) == list(range(1, 11))
