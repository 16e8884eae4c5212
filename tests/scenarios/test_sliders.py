"""The closed form of the sliders: forces by Coulomb's law in every phase, energy, and known ends."""

from itertools import pairwise

import numpy as np
import pytest

from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.scenario import GRAVITY

SCENES = ["sliders", *(f"sliders_seed{k}" for k in range(3))]


@pytest.mark.parametrize("name", SCENES)
def test_each_phase_obeys_coulombs_law(name: str) -> None:
    """Friction opposes each slip at mu N, and holds what is at rest."""
    scene = catalogue()[name]
    lower, upper = scene.bodies[1:]
    between, below = scene.pair_coefficients(1, 2)[1], scene.pair_coefficients(0, 1)[1]
    low, high = (truth.arcs for truth in scene.truths)
    edges = sorted({arc.start for arc in (*low, *high)} | {scene.duration})
    for start, end in pairwise(edges):
        step, t = 1e-4, np.array([(start + end) / 2])
        v, a = np.empty(2), np.empty(2)
        for k, truth in enumerate(scene.truths):
            before, now, after = (motion(scene, truth, t + d).velocity[0, 0] for d in (-step, 0, step))
            v[k], a[k] = now, (after - before) / (2 * step)
        carried, braked = upper.mass * a[1], lower.mass * a[0] + upper.mass * a[1]
        weight = (lower.mass + upper.mass) * GRAVITY
        for slip, force, most in (
            (v[1] - v[0], carried, between * upper.mass * GRAVITY),
            (v[0], braked, below * weight),
        ):
            if abs(slip) > 1e-12:
                assert force == pytest.approx(-np.sign(slip) * most, abs=1e-9)
            else:
                assert abs(force) <= most


def test_known_ends() -> None:
    """By hand: both meet at 0.45 m/s after 3 / 6.54 s; the upper block needs as long to stop as to start."""
    scene = catalogue()["sliders"]
    low, high = (motion(scene, truth, np.array([scene.duration])) for truth in scene.truths)
    assert high.position[0, 0] == pytest.approx(0.45 * 3 / 6.54, rel=1e-12)
    assert low.position[0, 0] == pytest.approx((3 + 0.45) / 2 * 3 / 6.54 + 0.45**2 / (2 * 4.905), rel=1e-12)
    assert not low.velocity.any()
    assert not high.velocity.any()
