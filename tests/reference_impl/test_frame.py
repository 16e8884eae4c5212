"""Whole frames: rest, and a flick with and without the compiler."""

import dataclasses
import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.reference.engine import ReferenceEngine
from touchstone.adapters.recorder import record
from touchstone.scenarios.catalogue import catalogue

PROFILES = tuple(ReferenceEngine.profiles)
SNIP_SHIFT = 0.26
"""How much earlier the flick starts in the short variant [s]: contact falls into frames 5 to 10."""
SNIP_FRAMES = 30


def short_snip():
    """The first 30 frames of `ball_snip` with the flick moved to 0.04 s."""
    scenario = catalogue()["ball_snip"]
    glove = scenario.trackers[0]
    first = round(SNIP_SHIFT * scenario.frame_rate) + 1
    kept = slice(first, first + SNIP_FRAMES + 1)
    times = tuple(k / scenario.frame_rate for k in range(SNIP_FRAMES + 1))
    glove = dataclasses.replace(
        glove,
        times=times,
        positions=glove.positions[kept],
        orientations=glove.orientations[kept],
        angles=glove.angles[kept],
    )
    duration = SNIP_FRAMES / scenario.frame_rate
    return dataclasses.replace(scenario, trackers=(glove,), duration=duration, expectations=())


def trajectory(scenario, profile: str) -> np.ndarray:
    """Poses and velocities of a run, one row per frame."""
    run = record(ReferenceEngine(), scenario, Settings(profile, 1 / 60))
    columns = (run.position, run.orientation, run.linear_velocity, run.angular_velocity)
    return np.concatenate([column.reshape(len(run.time), -1) for column in columns], axis=1)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("gap", [0.0, 5e-7, -5e-7])
def test_a_resting_ball_stays(lab: SimpleNamespace, profile: str, gap: float) -> None:
    """Hold a ball on the ground for ten seconds within a nanometre."""
    world = lab.build(lab.scene(lab.ball("b", (0.3, 0.2, 0.05 + gap)), lab.ground(), e=0.5, mu=0.3), profile)
    start = world.bodies[0]["position"].copy()
    seen = lab.play(world, 600, lambda w: w.bodies[0]["position"].copy())
    assert np.abs(np.array(seen) - start).max() < 1e-9
    assert np.abs(world.bodies[0]["velocity"]).max() < 1e-12


@pytest.mark.parametrize("profile", ["balanced", "paper"])
def test_python_gives_what_the_compiler_gives(tmp_path, profile: str) -> None:
    """Play 30 frames with finger contact without the compiler: the same to a nanometre."""
    scenario, out = short_snip(), tmp_path / "python.npy"
    compiled = trajectory(scenario, profile)
    ball = scenario.body_index("ball")
    assert np.linalg.norm(compiled[-1, 3 * ball : 3 * ball + 2] - compiled[0, 3 * ball : 3 * ball + 2]) > 0.05
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    subprocess.run([sys.executable, __file__, profile, str(out)], env=environment, check=True)
    # sines and square roots may differ in the last bit; 30 frames of one contact magnify that little
    np.testing.assert_allclose(np.load(out), compiled, atol=1e-9)


if __name__ == "__main__":
    np.save(sys.argv[2], trajectory(short_snip(), sys.argv[1]))
