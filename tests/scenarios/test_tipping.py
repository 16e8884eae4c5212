"""Prisms and blocks that tip, by quadrature; bodies that start in one place."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.places import coinciding
from touchstone.scenarios.scenario import GRAVITY, Hull, Piece, ScenarioError
from touchstone.scenarios.solids import ball, block, hull
from touchstone.scenarios.truths.body_motion import Motion
from touchstone.scenarios.truths.tipping import phases

SCENE = catalogue()["prism_rolls"]
PRISM = SCENE.bodies[1]
HALF_SIDE = np.pi / 12
RADIUS, SLOPE = 0.1, np.radians(8.0)
INERTIA = PRISM.inertia[1][1]

STARTS = np.array([phase.start for phase in phases(SCENE, PRISM)])


def played(times: np.ndarray) -> Motion:
    """The truth at some times."""
    return motion(SCENE, SCENE.truths[0], times)


def test_each_edge_by_quadrature() -> None:
    """The leg turns from -15 to 15 degrees about the normal; its energy gives the time that this takes."""
    about_edge = INERTIA + PRISM.mass * RADIUS**2
    kept = (INERTIA + PRISM.mass * RADIUS**2 * np.cos(2 * HALF_SIDE)) / about_edge
    rate, start = 5.0, 0.0

    def pace(angle: float) -> float:
        # the leg leans back from the vertical by its angle less the slope
        fall = np.cos(HALF_SIDE - SLOPE) - np.cos(angle + SLOPE)
        return float(np.sqrt(rate**2 + 2 * PRISM.mass * GRAVITY * RADIUS * fall / about_edge))

    for edge in STARTS[1:]:
        start += quad(lambda a: 1 / pace(a), -HALF_SIDE, HALF_SIDE, epsabs=1e-14, epsrel=1e-13)[0]
        assert edge == pytest.approx(start, abs=1e-11)
        rate = kept * pace(HALF_SIDE)
        assert played(np.array([edge])).angular_velocity[0, 1] == pytest.approx(rate, rel=1e-11)


def test_what_the_law_does_not_cover() -> None:
    """A ball and a slope that is none are refused."""
    ball = catalogue()["ball_off_sphere"].bodies
    for bodies, message in (
        ((SCENE.bodies[0], replace(ball[1], name="prism")), "a body of one hull"),
        ((ball[0], PRISM), "one fixed box"),
    ):
        with pytest.raises(ScenarioError, match=message):
            replace(SCENE, bodies=bodies)


def test_a_block_rocks_by_quadrature() -> None:
    """A block falls back in the time that its energy gives; the impact keeps 1 - 3/2 sin^2 of its rate, and
    the block turns round where it has risen by the energy that is left."""
    scene = catalogue()["rocking_block"]
    block, (first, second, third) = scene.bodies[1], phases(scene, scene.bodies[1])[:3]
    critical, reach = np.arctan(0.2), np.hypot(0.05, 0.25)
    lean, scale = critical / 2, 3 * GRAVITY / (2 * reach)
    assert first.start == 0
    # the tilt is lean (1 - u^2), so that the pace is finite at u = 0
    fallen = quad(
        lambda u: (
            2 * lean * u / np.sqrt(scale * (np.cos(critical - lean) - np.cos(critical - lean * (1 - u * u))))
        ),
        0,
        1,
        epsabs=1e-13,
    )[0]
    assert second.start == pytest.approx(fallen, rel=1e-9)
    fast = np.sqrt(scale * (np.cos(critical - lean) - np.cos(critical)))
    kept = 1 - 3 / 2 * np.sin(critical) ** 2
    at = motion(scene, scene.truths[0], np.linspace(second.start, third.start - 1e-12, 4001))
    assert abs(at.angular_velocity[0, 1]) == pytest.approx(kept * fast, rel=1e-9)
    highest = np.arccos(np.cos(critical) + (kept * fast) ** 2 / scale)
    tilt = Rotation.from_quat(at.orientation, scalar_first=True).magnitude().max()
    assert tilt == pytest.approx(critical - highest, abs=1e-8)
    assert block.inertia[1][1] == pytest.approx((0.05**2 + 0.25**2) / 3)


HERE = (0.3, -0.2, 1.0)
CORNERS = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ONE = ball("one", "wood", 0.05, 1.0, HERE)


@pytest.mark.parametrize(
    "other",
    [
        ball("two", "wood", 0.03, 2.0, HERE),
        block("two", "wood", (0.1, 0.1, 0.1), 1.0, HERE),
        block("two", "wood", (0.1, 0.1, 0.1), kind="fixed", position=HERE),
        # the mean of the corners of a tetrahedron is its centre of mass
        hull("two", "wood", CORNERS, 1.0, HERE),
    ],
    ids=("ball", "block", "fixed", "hull"),
)
def test_bodies_in_one_place_are_told(lab, other):
    """Name two bodies with one centre, whatever their shapes, and their place, in one line."""
    expected = (
        "bodies[2].position: 'two' starts where 'one' does: pieces of both have their centre at "
        "(0.3, -0.2, 1) m; move one of them"
    )
    assert coinciding(lab.scene(ONE, lab.ground(), other)) == expected


def test_overlap_is_no_fault(lab):
    """Say nothing of bodies that overlap, of fixed bodies in one place, and of one body's pieces in one."""
    near = (HERE[0] + 1e-6, *HERE[1:])
    twice = (Piece("one", Hull(CORNERS)), Piece("two", Hull(CORNERS)))
    scene = lab.scene(
        ONE,
        ball("two", "wood", 0.05, 1.0, near),
        replace(lab.ball("three", (5.0, 0.0, 1.0)), pieces=twice),
        lab.ground(),
        replace(lab.ground(), name="again"),
    )
    assert coinciding(scene) is None
    assert coinciding(lab.scene(ONE)) is None
