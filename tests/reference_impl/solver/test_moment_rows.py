"""Rows of rolling and torsional friction: maximum dissipation within their bounds."""

from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reference_impl.solver.contact_rows import residual_of
from touchstone.reference_impl.solver.moment_rows import solve_moment, worst_moment

SEEDS = range(40)


def row_of(lab: SimpleNamespace, rng: np.random.Generator, friction: float) -> np.void:
    """A solver with one moment of a body whose inertia differs by axis, and a contact that presses."""
    solver = lab.build(lab.scene(lab.ground(), lab.ball())).state[0]["solver"]
    solver["row_count"] = solver["mover_count"] = solver["moment_count"] = 1
    solver["link_count"] = 0
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    row, mover, moment = solver["rows"][0], solver["movers"][0], solver["moments"][0]
    row["a"], row["b"], row["link_a"], row["link_b"] = -1, 0, -1, -1
    row["normal"], row["across_1"], row["across_2"] = axes
    row["impulse"] = rng.uniform(0.1, 2.0) * axes[0]
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    mover["inverse_inertia"] = turn @ np.diag(rng.uniform(0.5, 5.0, 3)) @ turn.T
    mover["velocity"] = mover["omega"] = 0.0
    moment["row"], moment["arm"] = 0, rng.uniform(0.1, 2.0)
    moment["rolling"], moment["torsion"] = friction * rng.uniform(0.1, 1.0, 2)
    moment["mobility"] = moment["arm"] ** 2 * mover["inverse_inertia"]
    moment["mass"] = 3 / np.trace(moment["mobility"])
    moment["free"], moment["impulse"] = rng.normal(size=3), 0.0
    return solver


@pytest.mark.parametrize("friction", [0.02, 0.3, 10.0])
def test_a_moment_takes_the_most_power(lab: SimpleNamespace, friction: float) -> None:
    """Reach the bound against what turns on, hold what does not, and stay within the bounds."""
    for seed in SEEDS:
        solver = row_of(lab, np.random.default_rng(seed), friction)
        moment, n = solver["moments"][0], solver["rows"][0]["normal"]
        load = solver["rows"][0]["impulse"] @ n
        for _ in range(200):
            solve_moment(moment, solver)
        left, _ = worst_moment(solver)
        assert left < 1e-13
        u = moment["free"] + moment["arm"] * solver["movers"][0]["omega"]
        p = moment["impulse"]
        for part, bound in ((np.outer(n, n), "torsion"), (np.eye(3) - np.outer(n, n), "rolling")):
            limit = load * moment[bound]
            size, speed = np.linalg.norm(part @ p), np.linalg.norm(part @ u)
            assert size <= limit * (1 + 1e-12)
            # against the turning, by all of the bound
            assert (part @ p) @ u == pytest.approx(-limit * speed, abs=1e-11)


def test_a_heap_with_moments_obeys_their_law(lab: SimpleNamespace) -> None:
    """Solve balls, boxes and their moments together: what is left of the laws of all is the residual."""
    balls = [lab.ball(f"ball_{k}", (0.0, 0.004 * k, 0.05 + 0.1 * k)) for k in range(3)]
    spun = lab.ball("top", (0.0, 0.0, 0.35), angular_velocity=(3.0, 1.0, 5.0))
    laws = {"rolling_friction": 5e-3, "torsional_friction": 2e-3}
    world = lab.build(lab.scene(lab.ground(), *balls, spun, mu=0.4, laws=laws))
    for _ in range(20):
        lab.play(world, 1)
        solver = world.state[0]["solver"]
        if solver["moment_count"] == 0:
            continue
        assert residual_of(solver)[0] < 1e-9
        for moment in solver["moments"][: solver["moment_count"]]:
            row = solver["rows"][moment["row"]]
            along = moment["impulse"] @ row["normal"]
            load = row["impulse"] @ row["normal"]
            across = np.linalg.norm(moment["impulse"] - along * row["normal"])
            assert abs(along) <= moment["torsion"] * load * (1 + 1e-12)
            assert across <= moment["rolling"] * load * (1 + 1e-12)
