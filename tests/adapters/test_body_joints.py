"""Joints between bodies in the engines: their motion tends to the scene's truth as the step shrinks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from touchstone.adapters.contract import Settings, Unsupported
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import installed, load
from touchstone.adapters.scripts.process import written
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.families.literature import even
from touchstone.scenarios.scenario import BodyJoint, Scenario
from touchstone.scenarios.solids import ball, slab

ENGINES = [name for name in ("mujoco", "dart") if installed(name)]
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
    if not installed("bullet"):
        pytest.skip("bullet is not installed")
    with pytest.raises(Unsupported, match="bullet: the adapter has no joints between bodies"):
        record(load("bullet"), catalogue()["four_bar"], Settings("recommended", 1 / 240))


def test_no_script_is_written_of_joints() -> None:
    """Scripts in an engine's own API have no words for joints."""
    with pytest.raises(Unsupported, match="mujoco: no words for joints between bodies"):
        written(catalogue()["four_bar"], "mujoco", Settings("recommended", 1 / 480))


@pytest.mark.parametrize("engine", ["reference", *ENGINES])
@pytest.mark.parametrize("groups", [(("a", "b", "c"),), (("a", "c"), ("b", "c"))], ids=["a group", "pairs"])
def test_excluded_bodies_pass_through_each_other(engine: str, groups: tuple[tuple[str, ...], ...]) -> None:
    """A ball falls through those that a joint holds, onto the floor, which it was not excluded from."""
    one, two = (ball(n, "steel", 0.1, 1.0, (x, 0.0, 0.5)) for n, x in (("a", 0.0), ("b", 0.25)))
    third = ball("c", "steel", 0.1, 1.0, (0.1, 0.0, 0.75))
    hinge = BodyJoint("h", "hinge", "a", "b", (0.12, 0.0, 0.5))
    pin = BodyJoint("p", "fixed", "", "a", (0.0, 0.0, 0.5))
    scenario = Scenario(
        "s", "", (), (slab("floor", "steel"), one, two, third), 1.0, even("steel", mu=0.5),
        body_joints=(pin, replace(hinge, axis=(0.0, 1.0, 0.0), stiffness=1e4, damping=100.0)),
        contact_exclusions=groups,
    )  # fmt: skip
    profile, dt = ("balanced", 1 / 60) if engine == "reference" else ("recommended", 1 / 240)
    fallen = record(load(engine), scenario, Settings(profile, dt)).position[-1, 3]
    assert np.abs(fallen - (0.1, 0.0, 0.1)).max() < 0.01
    held = record(load(engine), replace(scenario, contact_exclusions=()), Settings(profile, dt))
    assert np.linalg.norm(held.position[:, 3] - held.position[:, 1], axis=1).min() > 0.19
