"""Joints between bodies in the engines: their motion tends to the scene's truth as the step shrinks."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.adapters.contract import Settings, Unsupported
from touchstone.adapters.recorder import build, record
from touchstone.adapters.registry import installed, load
from touchstone.adapters.scripts.process import written
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.closed_form import motion

ENGINES = [name for name in ("mujoco", "dart", "bullet") if installed(name)]
SMOOTH = ("double_pendulum", "spherical_pendulum", "slider_spring", "hinged_pair")


def error(engine: str, scene: str, rate: int, seconds: float = 0.5) -> float:
    """Largest distance of a body from its truth over the first frames [m]."""
    scenario = replace(catalogue()[scene], duration=seconds, expectations=(), published=())
    kept = record(load(engine), scenario, Settings("recommended", 1 / rate))
    found = []
    for truth in scenario.truths:
        true = motion(scenario, truth, kept.time)
        found.append(np.abs(kept.position[:, scenario.body_index(truth.body)] - true.position).max())
    return float(max(found))


@pytest.mark.parametrize("scene", SMOOTH)
@pytest.mark.parametrize("engine", ENGINES)
def test_the_error_falls_with_the_step(engine: str, scene: str) -> None:
    """Integrators of first order come four times as near at a quarter of the step."""
    coarse, fine = error(engine, scene, 480), error(engine, scene, 1920)
    assert fine < 0.3 * coarse
    assert coarse < 0.05


@pytest.mark.parametrize("engine", ENGINES)
def test_a_loop_closes_as_far_as_constraints_are_stiff(engine: str) -> None:
    """The bars of a four-bar follow the truth to some millimetres in half a second."""
    assert error(engine, "four_bar", 1920) < 0.01


@pytest.mark.parametrize("engine", ENGINES)
def test_a_motor_drives_its_wheel(engine: str) -> None:
    """The motor's largest torque accelerates, and its target rate ends that."""
    scenario = catalogue()["motor_hinge"]
    kept = record(load(engine), scenario, Settings("recommended", 1 / 480))
    assert np.abs(kept.angular_velocity[-1, 0]).max() == pytest.approx(10.0, abs=0.05)


@pytest.mark.parametrize("engine", ENGINES)
def test_what_closes_no_loop_is_named(engine: str) -> None:
    """A limit of a joint that closes a loop is refused in one line."""
    scenario = catalogue()["four_bar"]
    limited = tuple(replace(joint, lower=-3.0, upper=3.0) for joint in scenario.body_joints)
    with pytest.raises(Unsupported, match=rf"{engine}: no hinge with forces or limits closes a loop"):
        record(
            load(engine), replace(scenario, body_joints=limited, truths=()), Settings("recommended", 1 / 480)
        )


def test_an_engine_without_joints_refuses_them() -> None:
    """The recorder says so before anything is built."""
    with pytest.raises(Unsupported, match="toy: the adapter has no joints between bodies"):
        build(SimpleNamespace(name="toy"), catalogue()["four_bar"], Settings("recommended", 1 / 240))


def test_no_script_is_written_of_joints() -> None:
    """Scripts in an engine's own API have no words for joints."""
    with pytest.raises(Unsupported, match="mujoco: no words for joints between bodies"):
        written(catalogue()["four_bar"], "mujoco", Settings("recommended", 1 / 480))
