"""Time of impact against closed forms, dense sampling and rays: never late, never without cause."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moving_pair import CLOSE, NEAR, ROUNDING, Scene, assert_true
from scipy.spatial.transform import Rotation

from touchstone.adapters.oracles.minkowski import signed_distance
from touchstone.reference_impl.continuous.swept_motion import swept_box
from touchstone.reference_impl.continuous.time_of_impact import TIME_OF_IMPACT_STEPS
from touchstone.reference_impl.core.conventions import IMPACT_SLACK, IMPACT_TARGET
from touchstone.scenarios.scenario import Box, Ellipsoid, Hull, Sphere
from touchstone.scenarios.solids import elliptic_hull

FRAME = 1 / 60
SLOPE = np.array([2.0, -1.0, 2.0]) / 3


@pytest.mark.parametrize("spin", [(0, 0, 0), (3, -5, 40)])
def test_a_sphere_meets_a_plane(spin) -> None:
    """Close a gap of 0.2 m at 0.5 m a step, whatever the spin, in a few iterations."""
    scene = Scene(Box((3.0, 3.0, 0.5)), Sphere(0.1)).move(0, (0, 0, -0.5))
    fraction, iterations, converged = scene.move(1, (0.3, 0.1, 0.3), (0.2, 0.1, -0.5), spin).impact()
    assert converged
    assert iterations <= 3
    assert 0 <= 0.4 - IMPACT_TARGET / 0.5 - fraction + ROUNDING <= IMPACT_SLACK / 0.5


@pytest.mark.parametrize(("aside", "meets"), [(1e-6, False), (4e-7, True)])
def test_spheres_that_pass_each_other(aside: float, meets: bool) -> None:
    """Let spheres pass at 1e-6 m and report those that come nearer than the target."""
    scene = Scene(Sphere(0.1), Sphere(0.2)).move(0)
    fraction, _, converged = scene.move(1, (-1, 0.3 + aside, 0), (2, 0, 0)).impact()
    assert converged
    assert (fraction < 0.5) is meets
    assert meets or fraction == 1


@pytest.mark.parametrize("spin", [30.0, 300.0])
def test_a_fast_rod_hits_a_peg(spin: float) -> None:
    """Stop a 1 m rod within its first turn at a thin peg that it would else pass dozens of times."""
    scene = Scene(Sphere(0.001), Box((0.5, 0.005, 0.005))).move(0, (0.24, 0.32, 0))
    fraction, _, converged = scene.move(1, turn=(0, 0, spin)).impact()
    # the peg's centre, 0.4 m out, is then its radius and half the rod's width away from the rod's axis
    early, late = (np.arctan2(4, 3) - np.arcsin((0.006 + gap) / 0.4) for gap in (NEAR, IMPACT_TARGET))
    assert converged
    assert early - ROUNDING <= fraction * spin <= late + ROUNDING


def test_nothing_moves() -> None:
    """Report no impact without motion, at once."""
    scene = Scene(Box((1.0, 1.0, 1.0)), Ellipsoid((0.3, 0.2, 0.1))).move(0).move(1, (0, 0, 1.2))
    assert scene.impact() == (1.0, 1, True)


def test_a_pair_that_parts() -> None:
    """Report no impact of a pair that parts, whose spin could reach back only at first."""
    scene = Scene(Box((1.0, 1.0, 1.0)), Box((0.3, 0.2, 0.1))).move(0).move(1, (0, 0, 1.11), (0, 0, 0.7))
    assert scene.impact()[::2] == (1.0, True)
    scene.bodies[1]["turn"] = (2.0, 0, 0)
    assert scene.impact()[::2] == (1.0, True)


@pytest.mark.parametrize("height", [1.05, 1.1, 1.1 + 6e-7])
def test_a_pair_in_contact(height: float) -> None:
    """Return the start for a pair that overlaps or touches there."""
    scene = Scene(Box((1.0, 1.0, 1.0)), Box((0.3, 0.2, 0.1))).move(0).move(1, (0, 0, height), (0, 0, 0.7))
    assert scene.impact() == (0.0, 1, True)
    assert scene.impact(start=0.3)[0] == (0.3 if height + 0.21 < 1.1 else 1.0)


def test_a_part_of_the_step() -> None:
    """Search between `start` and `until` alone."""
    scene = Scene(Box((1.0, 1.0, 1.0)), Sphere(0.1)).move(0).move(1, (0, 0, 2.1), (0, 0, -2.0))
    whole, _, _ = scene.impact()
    assert scene.impact(until=0.4)[::2] == (0.4, True)
    fraction, _, _ = scene.impact(start=0.3)
    assert abs(fraction - whole) <= IMPACT_SLACK / 2


def test_a_depth_is_a_target_too() -> None:
    """Find where a sphere has sunk a centimetre into a box."""
    scene = Scene(Box((1.0, 1.0, 1.0)), Sphere(0.1)).move(0).move(1, (0, 0, 1.15), (0, 0, -0.2))
    fraction, _, converged = scene.impact(target=-0.01)
    assert converged
    assert 0 <= 0.3 - fraction + ROUNDING <= IMPACT_SLACK / 0.2


@pytest.mark.parametrize("half", [1e-3, 1e-6, 1e-9])
def test_a_needle_thin_plate_stops_a_bullet(half: float) -> None:
    """Stop a bullet of a millimetre at 100 m/s before a plate down to two nanometres thin."""
    bullet = Hull(elliptic_hull((5e-4, 4e-4, 3e-4)))
    scene = Scene(Box((0.5, 0.5, half)), bullet).move(0, posture=Rotation.from_rotvec([0.3, 0.2, 0.1]))
    scene.move(1, 0.7 * SLOPE, -100 * FRAME * SLOPE, (5.0, 9.0, -20.0))
    found = scene.impact()
    assert found[0] < 0.42
    assert_true(scene, found, np.linspace(0.4, 0.42, 400))


@pytest.mark.parametrize("spin", [0.001, 0.01, 0.1])
def test_a_face_that_tips_on_an_edge(spin: float) -> None:
    """Sweep a plate that tips about the edge of a box which it stays in contact with, in few iterations."""
    edge = np.array([0.0, 0.0, 0.2])
    up = np.array([0.0, 0.0, 0.02])
    scene = Scene(Box((0.01, 0.1, 0.2)), Box((0.3, 0.1, 0.02))).move(0, (-0.01, 0, 0))
    # the plate's lower face leans by 0.3 rad, and rotates about the edge
    lean = Rotation.from_rotvec([0, 0.3, 0])
    scene.move(1, edge + lean.apply(up), turn=(0, spin, 0), posture=lean)
    away = np.cross([0, spin, 0], lean.apply(up))
    scene.bodies[1]["travel"] = away
    scene.bodies[1]["travel_bend"] = np.cross([0, spin / 2, 0], away)
    fraction, iterations, converged = scene.impact(target=-1e-6)
    assert converged
    assert iterations <= 100
    assert scene.distance(fraction / 2) > -1e-6 - CLOSE
    if spin < 0.1:
        assert fraction == 1


def test_a_cap_is_reported_and_safe() -> None:
    """Stop a hopelessly fast wheel at the cap, unconverged, at a fraction that is still free."""
    rim = [(0.3 * np.cos(a), 0.3 * np.sin(a), z) for a in np.arange(7) for z in (-0.02, 0.02)]
    scene = Scene(Box((1.0, 1.0, 1.0)), Hull(tuple(rim))).move(0)
    scene.move(1, (1.31, 0, 0), (-0.02, 0, 0), (0, 0, 1e6))
    fraction, iterations, converged = scene.impact()
    assert not converged
    assert iterations == TIME_OF_IMPACT_STEPS
    assert 0 < fraction < 0.5
    assert scene.distance(fraction) > NEAR


numbers = st.floats(-1, 1, allow_subnormal=False)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
rotations = vectors.map(lambda v: Rotation.from_rotvec(3 * v))
sizes = st.floats(0.02, 0.4)
solids = st.one_of(
    st.builds(lambda *half: Box(half), sizes, sizes, sizes),
    st.builds(lambda *half: Hull(elliptic_hull(half)), sizes, sizes, sizes),
)
shapes = st.one_of(
    solids, st.builds(Sphere, sizes), st.builds(lambda *half: Ellipsoid(half), sizes, sizes, sizes)
)


@st.composite
def scenes(draw: st.DrawFn, shapes: st.SearchStrategy = shapes) -> Scene:
    """Two shapes off their centres of mass on bent, turning ways towards each other."""
    scene = Scene(draw(shapes), draw(shapes))
    for k, side in enumerate((-1, 1)):
        center = np.array([0.6 * side, 0, 0]) + 0.2 * draw(vectors)
        travel = np.array([-0.8 * side, 0, 0]) + 0.4 * draw(vectors)
        spin = draw(st.sampled_from([0.0, 0.1, 2.0, 10.0]))
        bend = {"travel_bend": 0.3 * draw(vectors), "turn_bend": spin * draw(vectors) * draw(st.booleans())}
        scene.move(k, center, travel, spin * draw(vectors), posture=draw(rotations), **bend)
        scene.bodies[k]["center_of_mass"] = 0.1 * draw(vectors)
        scene.pieces[k]["position"] = 0.1 * draw(vectors)
        scene.pieces[k]["rotation"] = draw(rotations).as_matrix()
    return scene


@st.composite
def tumbling_scenes(draw: st.DrawFn, shapes: st.SearchStrategy = shapes) -> Scene:
    """Two shapes of which at least one rotates without torque."""
    scene = draw(scenes(shapes))
    for k in range(1 + draw(st.booleans())):
        squares = 10.0 ** np.array([draw(st.floats(-2, 0)) for _ in range(3)])
        rate = draw(st.sampled_from([0.3, 6.0])) * draw(vectors)
        scene.spin_freely(k, np.diag(squares.sum() - squares), rate)
    return scene


any_scenes = st.one_of(scenes(), tumbling_scenes())


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(any_scenes)
def test_never_later_than_dense_sampling(scene: Scene) -> None:
    """Report no impact later than a sample that is nearer than the target, and none without cause."""
    found = scene.impact()
    if found[0] == 0:
        assert scene.distance(0.0) <= NEAR
    else:
        assert_true(scene, found, np.linspace(0, 1, 200))
        # the last stretch in detail
        assert_true(scene, found, found[0] - np.geomspace(1e-8, 0.01, 20))


@settings(max_examples=40, deadline=None)
@given(st.one_of(scenes(solids), tumbling_scenes(solids)))
def test_the_gap_of_an_impact_is_that_of_the_minkowski_difference(scene: Scene) -> None:
    """Leave at the fraction found the gap that the explicit Minkowski difference has."""
    fraction, _, converged = scene.impact()
    assert converged
    if 0 < fraction < 1:
        scene.distance(fraction)
        distance, _ = signed_distance(scene.corners(0), scene.corners(1))
        assert IMPACT_TARGET - CLOSE <= distance <= NEAR + CLOSE


@settings(max_examples=60, deadline=None)
@given(scenes(), vectors, rotations)
def test_swapped_or_moved_as_a_whole(scene: Scene, shift: np.ndarray, turned: Rotation) -> None:
    """Find the same impact with A and B swapped, and with the world moved and turned."""
    fraction, _, _ = scene.impact()
    scene.pairs[["piece_a", "piece_b", "body_a", "body_b"]] = (1, 0, 1, 0)
    swapped, _, _ = scene.impact()
    for row in scene.bodies:
        posture = turned * Rotation.from_quat(row["old_orientation"], scalar_first=True)
        row["old_center"], row["old_orientation"] = (
            turned.apply(row["old_center"]) + shift,
            posture.as_quat(scalar_first=True),
        )
        for name in ("travel", "travel_bend", "turn", "turn_bend"):
            row[name] = turned.apply(row[name])
    moved, _, _ = scene.impact()
    for other in (swapped, moved):
        # both ways stop in the slack's band: the earlier one is nearer than NEAR, and so is all between
        early, late = min(fraction, other), max(fraction, other)
        for s in np.linspace(early, late, 5):
            assert scene.distance(s) <= NEAR + CLOSE or early == late


@settings(max_examples=60, deadline=None)
@given(any_scenes)
def test_a_swept_box_holds_the_whole_motion(scene: Scene) -> None:
    """Keep the piece inside its swept box all along, to rounding."""
    for k in range(2):
        row, body = scene.pieces[k], scene.bodies[k]
        swept_box(row, body, scene.vertices, 0.0)
        low, high = row["low"].copy(), row["high"].copy()
        for s in np.linspace(0, 1, 20):
            scene.distance(s)
            assert (row["low"] >= low - ROUNDING).all()
            assert (row["high"] <= high + ROUNDING).all()
