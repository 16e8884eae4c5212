"""Contacts that hold together: the laws of each, stacks, and how many sweeps they take."""

from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reference_impl.solver.tolerances import RESIDUAL_ACCEPTED

HALF = 0.05


def tower(lab: SimpleNamespace, boxes: int, top=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0)):
    """A world of cubes on each other, the topmost with a velocity and a spin."""
    blocks = [
        lab.block(
            f"box_{k}",
            (HALF,) * 3,
            (0.0, 0.0, (2 * k + 1) * HALF),
            linear_velocity=top if k == boxes - 1 else (0.0, 0.0, 0.0),
            angular_velocity=spin if k == boxes - 1 else (0.0, 0.0, 0.0),
        )
        for k in range(boxes)
    ]
    return lab.build(lab.scene(*blocks, lab.ground(), mu=0.5))


def assert_held(rows: np.ndarray, mu: float, left: float) -> None:
    """No approach left, impulses in the cone, and at its edge against the mean of what still slides, in every
    row."""
    n, v = rows["normal"], rows["velocity_b_after"] - rows["velocity_a_after"]
    j, v_n = (rows["impulse"] * n).sum(1), (v * n).sum(1)
    across, end = rows["impulse"] - j[:, None] * n, v - v_n[:, None] * n
    start = rows["velocity_b_before"] - rows["velocity_a_before"]
    slip = (start - (start * n).sum(1)[:, None] * n + end) / 2
    speed = np.linalg.norm(slip, axis=1)
    # residuals of a sweep add up over the rows of a body
    assert v_n.min() >= -left
    assert j.min() >= 0
    assert (np.linalg.norm(across, axis=1) <= mu * j * (1 + 1e-12)).all()
    slides = np.linalg.norm(end, axis=1) > 1e-6
    work = (across * slip).sum(1)
    np.testing.assert_allclose(work[slides], -mu * (j * speed)[slides], rtol=1e-9)


@pytest.mark.parametrize("boxes", [1, 2, 5, 8])
def test_a_tower_stands(lab: SimpleNamespace, boxes: int) -> None:
    """Hold a new tower in some sweeps, and in few from the forces of the frame before, all at rest."""
    world = tower(lab, boxes)
    reported = lab.play(world, 30, watch=lab.counters)
    assert not any(frame["unconverged"] or frame["events"] or frame["impulses"] for frame in reported)
    assert reported[0]["sweeps"] <= 30 * boxes
    assert np.mean([frame["sweeps"] for frame in reported[10:]]) <= 10
    assert np.abs(world.bodies["velocity"]).max() < 1e-10
    assert np.abs(world.bodies["omega"]).max() < 1e-9


@pytest.mark.parametrize(
    ("top", "spin", "left"),
    [
        # at a stop, where the cone is full and nothing slides, the last sweeps stall below 1e-9 m/s
        ((0.03, 0.01, 0.0), (0.0, 0.0, 0.0), 1e-9),
        ((0.3, 0.1, 0.0), (0.0, 0.0, 0.0), 100 * RESIDUAL_ACCEPTED),
        ((0.3, -0.1, 0.0), (0.0, 0.0, 3.0), 100 * RESIDUAL_ACCEPTED),
    ],
)
def test_a_pushed_tower_obeys_coulomb(lab: SimpleNamespace, top, spin, left) -> None:
    """Push the topmost of five boxes: friction stops it, brakes it, or brakes a turn too, in its cone."""
    world = tower(lab, 5, top, spin)
    lab.play(world, 1)
    assert_held(world.contacts[: int(world.state[0]["contact_count"])], 0.5, left)


def test_weights_add_up(lab: SimpleNamespace) -> None:
    """Carry k + 1 boxes under the k-th from the top: m g h each, to rounding."""
    world = tower(lab, 5)
    lab.play(world, 3)
    rows = world.contacts[: int(world.state[0]["contact_count"])]
    for below in range(5):
        # the ground is the last body
        pair = {below, below - 1 if below else 5}
        reported = [row for row in rows if {int(row["body_a"]), int(row["body_b"])} == pair]
        weight = sum(abs(float(row["impulse"] @ row["normal"])) for row in reported)
        assert weight == pytest.approx((5 - below) * 9.81 / 60, rel=1e-10)


@pytest.mark.parametrize("heading", [0.0, 0.4])
def test_sliding_ends_within_a_frame(lab: SimpleNamespace, heading: float) -> None:
    """Stop a cube after v^2 / 2 mu g, wherever in a frame that is; a whole frame is off by 0.2 mm."""
    for speed in (0.5, 0.53, 0.57):
        v = speed * np.array((np.cos(heading), np.sin(heading), 0.0))
        world = tower(lab, 1, tuple(v.tolist()))
        lab.play(world, 12)
        way = np.hypot(*world.bodies["position"][0, :2])
        assert way == pytest.approx(speed**2 / (2 * 0.5 * 9.81), rel=1e-6)
        assert np.abs(world.bodies["velocity"]).max() < 1e-9


def test_bounces_do_not_use_up_a_frame(lab: SimpleNamespace) -> None:
    """Let balls of e = 0.97 come to rest in `accurate`: ever shorter bounces do not exceed the events of a
    frame, for those beyond half of them count as crowded."""
    drops = [lab.ball(f"ball_{k}", (0.2 * k, 0.0, 0.05 + 1e-4 + 3e-6 * k), radius=0.05) for k in range(6)]
    world = lab.build(lab.scene(*drops, lab.ground(), e=0.97), "accurate")
    reported = lab.play(world, 40, watch=lab.counters)
    assert max(frame["events"] for frame in reported) > 16
    assert not any(frame["gave_up"] for frame in reported)
    assert sum(frame["dense_substeps"] for frame in reported) > 0
    np.testing.assert_allclose(world.bodies["velocity"], 0.0, atol=1e-9)
