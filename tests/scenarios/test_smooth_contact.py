"""Truths of smooth contact against closed forms, laws of impact and differences of the motion itself."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.scenario import (
    GRAVITY,
    Body,
    Cylinder,
    Ellipsoid,
    Scenario,
    ScenarioError,
    Sphere,
    Truth,
)
from touchstone.scenarios.truths.body_motion import Motion
from touchstone.scenarios.truths.smooth_contact import phases

SCENES = [s.name for s in tagged("curved") if s.truths[0].law == "smooth_contact"]
LONG, START = 1.1, np.radians(5.0)
"""Distance of the balls' centres [m] and first angle [rad] in `ball_off_sphere`."""


def scene_of(name: str) -> tuple[Scenario, Body]:
    """A scene and the body of its truth."""
    scene = catalogue()[name]
    return scene, scene.bodies[scene.body_index(scene.truths[0].body)]


def played(name: str, times: np.ndarray) -> Motion:
    """The truth of a scene at some times."""
    scene = catalogue()[name]
    return motion(scene, scene.truths[0], times)


def contact_points(scene: Scenario, body: Body, at: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normal, contact point from the centre of mass (n, 3) and gap to the nearest fixed piece (n,), by the
    support function of the body's first piece."""
    turn = Rotation.from_quat(at.orientation, scalar_first=True)
    arm = turn.apply(np.subtract(body.pieces[0].position, body.center_of_mass))
    unders, shape = scene.bodies[0].pieces, body.pieces[0].shape
    n, away = np.tile([0.0, 0.0, 1.0], (len(arm), 1)), (at.position + arm)[:, 2]
    if isinstance(unders[0].shape, Sphere):
        apart = np.stack([at.position + arm - np.array(piece.position) for piece in unders])
        nearest = np.linalg.norm(apart, axis=2).argmin(axis=0)
        n = apart[nearest, np.arange(len(arm))]
        distance = np.linalg.norm(n, axis=1)
        n, away = n / distance[:, None], distance - unders[0].shape.radius
    if isinstance(shape, Cylinder):
        local = turn.inv().apply(n)
        rim = shape.radius * local[:, :2] / np.linalg.norm(local[:, :2], axis=1)[:, None]
        deepest = -np.column_stack((rim, shape.half_length * np.sign(local[:, 2])))
        return n, arm + turn.apply(deepest), away + np.einsum("ni,ni->n", local, deepest)
    half = np.array(shape.half_axes if isinstance(shape, Ellipsoid) else [shape.radius] * 3)
    local = turn.inv().apply(n)
    depth = np.linalg.norm(half * local, axis=1)
    deepest = -(half**2) * local / depth[:, None]
    return n, arm + turn.apply(deepest), away - depth


def rates(rows: np.ndarray, step: float) -> np.ndarray:
    """Derivatives of seven samples in the middle, of order 6 (n, 7, 3) -> (n, 3)."""
    weights = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60
    return np.einsum("k,nki->ni", weights, rows) / step


@pytest.mark.parametrize("name", SCENES)
def test_the_motion_obeys_the_laws(name: str) -> None:
    """Newton's, Euler's and Coulomb's laws hold with rates from differences of the motion; it touches or
    flies."""
    scene, body = scene_of(name)
    step, mu = 3e-4, scene.pair_coefficients(0, 1)[1]
    inertia = np.array(body.inertia)
    parts = phases(scene, body)
    ends = [*(part.start for part in parts[1:]), scene.duration]
    for part, end in zip(parts, ends):
        times = np.linspace(part.start, end, 40)[1:-1]
        times = times[np.minimum(times - part.start, end - times) > 4 * step]
        around = (times[:, None] + step * np.arange(-3, 4)).ravel()
        m = played(name, around)
        n, r, gap = contact_points(scene, body, m)
        turn = Rotation.from_quat(m.orientation, scalar_first=True)
        momentum = turn.apply(turn.inv().apply(m.angular_velocity) @ inertia)
        pace = rates(m.velocity.reshape(-1, 7, 3), step)
        torque = rates(momentum.reshape(-1, 7, 3), step)
        n, r, v, w = (x.reshape(-1, 7, 3)[:, 3] for x in (n, r, m.velocity, m.angular_velocity))
        force = body.mass * (pace - np.array(scene.gravity))
        scale = body.mass * GRAVITY
        # the differences: rounding of the velocity over the step, and the step to the power 6
        np.testing.assert_allclose(torque, np.cross(r, force), atol=1e-7 * scale * np.abs(r).max())
        if part.mode == "fly":
            np.testing.assert_allclose(force, 0, atol=1e-7 * scale)
            continue
        np.testing.assert_allclose(gap, 0, atol=1e-11)
        slip = v + np.cross(w, r)
        pressure = np.einsum("ni,ni->n", n, force)
        friction = force - pressure[:, None] * n
        sizes, speeds = np.linalg.norm(friction, axis=1), np.linalg.norm(slip, axis=1)
        assert (pressure > 0).all()
        if part.mode == "roll":
            assert speeds.max() < 1e-10
            assert (sizes < mu * pressure).all()
        else:
            np.testing.assert_allclose(sizes, mu * pressure, atol=1e-7 * scale)
            if mu:
                along = slip / speeds[:, None]
                np.testing.assert_allclose(np.einsum("ni,ni->n", along, friction), -sizes, atol=1e-7 * scale)


def energy(scene: Scenario, body: Body, m: Motion) -> np.ndarray:
    """Kinetic and potential energy [J]."""
    w = Rotation.from_quat(m.orientation, scalar_first=True).inv().apply(m.angular_velocity)
    spin = np.einsum("ni,ij,nj->n", w, body.inertia, w)
    moving = body.mass * (m.velocity**2).sum(axis=1) + spin
    return np.asarray(moving / 2 - body.mass * m.position @ np.array(scene.gravity))


def test_a_ball_slides_off_by_closed_form() -> None:
    """w^2 = 2 g (cos START - cos a) / L gives the time of each angle; it leaves at cos a = 2/3 cos START."""
    scene, body = scene_of("ball_off_sphere")
    leaves = np.arccos(2 / 3 * np.cos(START))

    def time(angle: float) -> float:
        # x^2 = a - START removes the singularity of 1 / w at the start
        def integrand(x: float) -> float:
            fall = 2 * np.sin(START + x * x / 2) * np.sin(x * x / 2) if x else 1.0
            return 2 * (x if x else np.sqrt(1 / np.sin(START))) / np.sqrt(2 * GRAVITY / LONG * fall)

        return float(quad(integrand, 0, np.sqrt(angle - START), epsabs=1e-13, epsrel=1e-13)[0])

    first, last = phases(scene, body)
    assert (first.mode, last.mode) == ("slide", "fly")
    assert last.start == pytest.approx(time(leaves), abs=1e-11)
    for t in (0.3, 0.6, 0.9):
        angle = brentq(lambda a: time(a) - t, START + 1e-6, leaves, xtol=1e-14)  # noqa: B023
        place = played("ball_off_sphere", np.array([t])).position[0]
        np.testing.assert_allclose(place, LONG * np.array([np.sin(angle), 0, np.cos(angle)]), atol=1e-11)


def test_what_the_law_does_not_cover() -> None:
    """An ellipsoid on a ball, a scene without support and a body that starts in the air are refused."""
    ball, rolls = catalogue()["ball_off_sphere"], catalogue()["ellipsoid_rolls"]
    for bodies in ((ball.bodies[0], replace(rolls.bodies[1], name="ball", material="wood")), ball.bodies[1:]):
        with pytest.raises(ScenarioError, match="expected a ball, or on fixed boxes or half-spaces"):
            replace(ball, bodies=bodies)
    with pytest.raises(ScenarioError, match=r"starts 8\.\d+ m from its support"):
        replace(rolls, bodies=(rolls.bodies[0], replace(rolls.bodies[1], position=(0.0, 0.0, 9.0))))


def test_a_landing_keeps_the_angular_momentum_about_its_place() -> None:
    """On the row of balls: the impulse acts where the ball lands, pushes, and takes energy."""
    scene, body = scene_of("bowl_of_balls")
    starts = np.array([part.start for part in phases(scene, body)][1:])
    assert len(starts) > 8
    before, after = (played("bowl_of_balls", starts + shift) for shift in (-1e-11, 1e-11))
    later = played("bowl_of_balls", starts + 1e-6)
    n, r, _ = contact_points(scene, body, later)
    momenta = [
        body.inertia[0][0] * m.angular_velocity - body.mass * np.cross(r, m.velocity) for m in (before, after)
    ]
    # the place of the contact moves by the way of a microsecond
    np.testing.assert_allclose(momenta[1], momenta[0], atol=1e-6 * np.abs(momenta[0]).max())
    assert (np.einsum("ni,ni->n", n, after.velocity - before.velocity) > 0).all()
    assert (energy(scene, body, after) < energy(scene, body, before)).all()


def test_a_bowl_of_flat_pieces_by_its_closed_form() -> None:
    """The integration over seven faces agrees with the arcs of constant acceleration."""
    scene = catalogue()["bowl"]
    times = np.linspace(0, scene.duration, 200)
    arcs = motion(scene, scene.truths[0], times)
    other = replace(scene, truths=(Truth("ball", "smooth_contact"),))
    integrated = motion(other, other.truths[0], times)
    for quantity in ("position", "velocity", "angular_velocity"):
        np.testing.assert_allclose(getattr(integrated, quantity), getattr(arcs, quantity), atol=1e-10)
