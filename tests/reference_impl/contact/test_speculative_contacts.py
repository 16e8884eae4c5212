"""Crowded frames: near pairs as contacts ahead of their time."""

from types import SimpleNamespace

import numpy as np
import pytest
from manifold_scenes import energy

from touchstone.reference_impl.contact.speculative_contacts import (
    DENSE_SUBSTEPS,
    TOUCH_CLOSED,
    gather_contacts,
)
from touchstone.reference_impl.core.conventions import (
    EVENT_CAP,
    IMPACT_SLACK,
    IMPACT_TARGET,
    OVERLAP_TOLERANCE,
    TOUCH_DISTANCE,
)
from touchstone.reference_impl.frame import step
from touchstone.scenarios.scenario import ORIGIN

RADIUS = 0.05


def crowded(lab: SimpleNamespace, *bodies, profile: str = "balanced", rows: int = -1, **fields: object):
    """A world whose frames count as crowded beyond so many contacts; -1: always."""
    world = lab.build(lab.scene(*bodies, **fields), profile)
    world.state["event_rows"] = rows
    return world


def test_no_time_is_lost_to_events(lab: SimpleNamespace) -> None:
    """Play the whole frame where more balls than a frame has events land and leave one after the other."""
    gaps = 2e-4 * np.arange(1, 71)
    balls = [
        lab.ball(f"ball_{k}", (0.2 * k, 0.0, float(RADIUS + gap)), linear_velocity=(0.0, 0.0, -1.0))
        for k, gap in enumerate(gaps)
    ]
    world = lab.build(lab.scene(*balls, lab.ground(), e=1.0, gravity=ORIGIN))
    step(*world)
    counted = lab.counters(world)
    assert (counted["gave_up"], counted["dense_substeps"] > 0) == (0, True)
    assert counted["events"] < EVENT_CAP
    np.testing.assert_allclose(world.bodies["velocity"][:70, 2], 1.0, rtol=1e-12)
    # early by twice what an impact is taken ahead, and by a substep at most once the frame is crowded
    late = world.bodies["position"][:70, 2] - RADIUS - (1 / 60 - gaps)
    ahead = 2 * (IMPACT_TARGET + IMPACT_SLACK)
    assert np.abs(late[:30]).max() <= ahead
    assert late.min() >= 0
    assert late.max() <= 2 / 60 / DENSE_SUBSTEPS


def test_a_near_pair_closes_its_gap(lab: SimpleNamespace) -> None:
    """Bring a ball that would fall through its gap to the ground, and no farther, in one substep."""
    world = crowded(lab, lab.ball("ball", (0.0, 0.0, RADIUS + 0.001)), lab.ground())
    step(*world)
    assert lab.counters(world)["events"] == 0
    assert world.bodies[0]["position"][2] - RADIUS == pytest.approx(TOUCH_CLOSED, abs=1e-12)
    # the impulse takes what gravity gave beyond twice the mean speed
    speed = 2 * (0.001 - TOUCH_CLOSED) * 60
    assert world.bodies[0]["velocity"][2] == pytest.approx(-speed, rel=1e-9)
    step(*world)
    np.testing.assert_allclose(world.bodies[0]["velocity"], 0, atol=1e-12)


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_an_early_impact_keeps_the_law(lab: SimpleNamespace, e: float) -> None:
    """Leave at e times the approach, before the surface, within one substep of the moment."""
    speed = 2.0
    ball = lab.ball("ball", (0.0, 0.0, RADIUS + 0.01), linear_velocity=(0.3, 0.0, -speed))
    world = crowded(lab, ball, lab.ground(), e=e, gravity=ORIGIN)
    step(*world)
    first = world.contacts[0]
    assert world.bodies[0]["velocity"][2] == pytest.approx(e * speed, rel=1e-12)
    assert world.bodies[0]["velocity"][0] == pytest.approx(0.3, rel=1e-12)
    assert 0 <= 0.01 / speed - first["time"] <= 1 / 60 / DENSE_SUBSTEPS
    assert world.bodies[0]["position"][2] > RADIUS


def test_no_ghost_is_hit(lab: SimpleNamespace) -> None:
    """Let a ball pass a plate's edge at 2 mm that it approaches fast, and bounce one that meets the edge."""
    plate = lab.block("plate", (0.1, 0.1, 0.005), (-0.1, 0.0, -0.005), kind="fixed")
    ends = []
    for aside in (0.002, -0.01):
        # towards the edge at the origin, passing it on the diagonal
        across = (RADIUS + aside) / np.sqrt(2)
        start = (float(-0.05 + across), 0.0, float(0.05 + across))
        ball = lab.ball("ball", start, linear_velocity=(6.0, 0.0, -6.0))
        world = crowded(lab, ball, plate, gravity=ORIGIN, e=0.5)
        step(*world)
        ends.append(world.bodies[0]["velocity"].copy())
        assert lab.counters(world)["dense_substeps"] > 0
    np.testing.assert_array_equal(ends[0], (6.0, 0.0, -6.0))
    assert np.linalg.norm(ends[1] - ends[0]) > 1


def test_a_bullet_does_not_tunnel_in_a_crowd(lab: SimpleNamespace) -> None:
    """Stop a ball of 1 mm at 100 m/s before a plate of 1 mm, and one that a hit starts within the frame."""
    plate = lab.block("plate", (0.5, 0.5, 5e-4), ORIGIN, kind="fixed")
    for k in range(20):
        bullet = lab.ball(
            "bullet", (0.01 * k, 0.0, 0.05 + 0.08 * k), radius=5e-4, linear_velocity=(0, 0, -100.0)
        )
        world = crowded(lab, bullet, plate, profile="accurate", gravity=ORIGIN, e=0.3)
        for _ in range(2):
            step(*world)
        assert world.bodies[0]["position"][2] > 1e-3 - OVERLAP_TOLERANCE
        assert world.bodies[0]["velocity"][2] > 0
    target = lab.ball("target", (0.0, 0.0, 0.2), radius=5e-4)
    bullet = lab.ball("bullet", (0.0, 0.0, 0.5), radius=5e-4, linear_velocity=(0, 0, -100.0))
    world = crowded(lab, bullet, target, plate, profile="accurate", gravity=ORIGIN, e=1.0)
    step(*world)
    assert (world.bodies["position"][:2, 2] > 1e-3 - OVERLAP_TOLERANCE).all()


@pytest.mark.parametrize("profile", ["balanced", "accurate"])
@pytest.mark.parametrize("rows", [-1, 60])
def test_a_heap_comes_to_rest(lab: SimpleNamespace, profile: str, rows: int) -> None:
    """Drop 27 balls into a box: they gain no energy, do not sink into each other, lose no time, and rest."""
    rng = np.random.default_rng(2)
    grid = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (1, 2, 3)])
    places = 0.11 * grid + rng.uniform(-2e-3, 2e-3, (27, 3))
    balls = [lab.ball(f"ball_{k}", tuple(map(float, place))) for k, place in enumerate(places)]
    walls = [
        lab.block(f"wall_{k}", (0.1, 0.4, 0.4), (0.27 * x, 0.27 * y, 0.4), kind="fixed", orientation=turn)
        for k, (x, y, turn) in enumerate(
            (x, y, (0.5**0.5, 0.0, 0.0, 0.5**0.5) if y else (1.0, 0.0, 0.0, 0.0))
            for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))
        )
    ]
    world = crowded(lab, *balls, *walls, lab.ground(), profile=profile, rows=rows, e=0.3, mu=0.3)
    energies, crowds = [energy(world)], 0
    for _ in range(240):
        step(*world)
        crowds += lab.counters(world)["dense_substeps"]
        energies.append(energy(world))
    # parting what sank lifts the heap of 27 kg: by less than 20 micrometres a frame
    assert np.diff(energies).max() < 27 * 9.81 * 2e-5
    assert crowds > 0
    centers = world.bodies["position"][:27]
    gaps = np.linalg.norm(centers[:, None] - centers[None], axis=2)[np.triu_indices(27, 1)] - 2 * RADIUS
    assert gaps.min() > -1e-5
    assert (np.abs(centers[:, :2]) < 0.17 - RADIUS + 1e-5).all()
    assert centers[:, 2].min() > RADIUS - 1e-5
    # what fell for four seconds without time lost lies by now: a ball may topple after two
    assert np.abs(world.bodies["velocity"]).max() < 0.05


@pytest.mark.parametrize("stale", [0.0, 5.0])
@pytest.mark.parametrize(("height", "rows"), [(1.8e-5, -1), (5e-7, 1000)])
def test_the_other_edge_of_a_touching_box_closes_its_gap_at_most(
    lab: SimpleNamespace, height: float, rows: int, stale: float
) -> None:
    """Let a tilted box touch the ground with one edge, and give its other edge the speed that closes its gap,
    whatever approach speed an earlier use of the pair's row has left; in a crowded frame up to 20 um away."""
    half, gap, dt = 0.05, 8e-7, 1 / 60
    angle = height / (2 * half)
    box = lab.block(
        "box",
        (half,) * 3,
        (0.0, 0.0, half * float(np.cos(angle) + np.sin(angle)) + gap),
        orientation=(float(np.cos(angle / 2)), 0.0, float(-np.sin(angle / 2)), 0.0),
        angular_velocity=(0.0, 1.0, 0.0),
    )
    world = crowded(lab, box, lab.ground(), rows=rows)
    world.pairs["key"] = stale
    end, h = gather_contacts(world.of_stages(), dt)
    found = world.pairs[:end]
    np.testing.assert_allclose(sorted(found["distance"]), [gap, gap, gap + height, gap + height], atol=1e-12)
    allowed = np.where(found["distance"] > TOUCH_DISTANCE, (found["distance"] - TOUCH_CLOSED) / h, 0.0)
    np.testing.assert_allclose(found["speculative_speed"], allowed, atol=1e-12)


def test_an_edge_meets_a_turning_face_in_two_points(lab: SimpleNamespace) -> None:
    """Give both ends of an edge that will land on a face a row each, though the face turns until then.

    Along the normal at the time of impact, only the top edges of both boxes are near: one end was found.
    """
    half, angle, gap = (0.025, 0.006, 0.05), 0.35, 2e-4
    s, c = float(np.sin(angle)), float(np.cos(angle))
    across, up = 0.006 * c + 0.05 * s, 0.05 * c - 0.006 * s
    one = lab.block(
        "leaning",
        half,
        (0.0, -0.006 - gap - across, 0.045 - up),
        orientation=(float(np.cos(angle / 2)), float(-np.sin(angle / 2)), 0.0, 0.0),
        linear_velocity=(0.0, 0.3, 0.0),
    )
    two = lab.block("turning", half, ORIGIN, angular_velocity=(-2.0, 0.0, 0.0))
    world = crowded(lab, one, two, gravity=ORIGIN)
    end, _ = gather_contacts(world.of_stages(), 1 / 60)
    found = world.pairs[:end]
    np.testing.assert_allclose(sorted(found["point_a"][:, 0]), [-0.025, 0.025], atol=1e-9)
    np.testing.assert_allclose(found["distance"], gap, atol=1e-9)
