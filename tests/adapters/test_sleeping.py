"""Sleeping where it is asked for: what each engine stops that would move on, when, and what it lets be."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.motion_bounds import planned
from touchstone.adapters.recorder import ready, record
from touchstone.adapters.recording import Recording
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.scenario import Scenario, Tracker

ENGINES = ("dart", "bullet", "mujoco")
STAGES = ("gravity", "rotation", "contact", "sleeping")
AFTER = {"dart": 0.5, "bullet": 2.0, "mujoco": 10 / 540}
"""Least time of quiet until an engine lets a body sleep [s]; of MuJoCo 10 steps."""
RESTED = {"dart": 1.0, "bullet": 2.5, "mujoco": 1.0}
"""Half a second longer and more [s]: a scene in which what is to sleep has long been asleep at its end."""
FASTEST = {"dart": 1e-3, "bullet": 0.05**0.5, "mujoco": 1e-3}
"""Speeds below which a body counts as quiet [m/s]: DART's smoothed speed under a tenth of its threshold of
10 mm/s, Bullet's v^2 + omega^2 under 0.05, MuJoCo's `sleep_tolerance`."""
SLOW = 5e-4
"""A speed that is quiet to every engine [m/s]."""
UNTURNED = (1.0, 0.0, 0.0, 0.0)


def sliding(lab: SimpleNamespace, speed: float, duration: float) -> Scenario:
    """A box that slides without friction."""
    box = lab.block("box", (0.05, 0.05, 0.05), (0.0, 0.0, 0.05), linear_velocity=(speed, 0.0, 0.0))
    return lab.scene(lab.ground(), box, duration=duration)


def played(registry: SimpleNamespace, name: str, scene: Scenario, *effects: str) -> Recording:
    """A scene with the effects named, or with those that it needs."""
    return record(registry.engine(name), scene, replace(registry.settings(name), effects=effects or None))


@pytest.mark.parametrize("name", ENGINES)
def test_a_slow_slide_is_stopped(lab: SimpleNamespace, registry: SimpleNamespace, name: str) -> None:
    """Stop a box after the engine's time of quiet that slides on with its plan and with all effects."""
    scene = sliding(lab, SLOW, RESTED[name])
    stopped = played(registry, name, scene, *STAGES)
    assert (stopped.linear_velocity[-1] == 0).all()
    # MuJoCo's soft contact settles faster than 1 mm/s for the first few steps
    assert AFTER[name] <= stopped.position[-1, 1, 0] / SLOW < AFTER[name] + 0.1
    for one in (played(registry, name, scene), played(registry, name, scene, *PLANNED)):
        assert one.position[-1, 1, 0] == pytest.approx(SLOW * scene.duration, rel=1e-9)


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_how_slow_is_quiet(lab: SimpleNamespace, registry: SimpleNamespace, name: str, factor: float) -> None:
    """Stop a box just below the engine's speed, and none just above."""
    end = played(registry, name, sliding(lab, factor * FASTEST[name], RESTED[name]), *STAGES)
    assert (end.linear_velocity[-1, 1, 0] == 0) == (factor < 1)


@pytest.mark.parametrize("name", ENGINES)
def test_in_the_open(lab: SimpleNamespace, registry: SimpleNamespace, name: str) -> None:
    """Stop a slow ball that meets nothing, but for DART: it lets none sleep without contact."""
    ball = lab.ball(linear_velocity=(SLOW, 0.0, 0.0))
    scene = lab.scene(ball, gravity=(0.0, 0.0, 0.0), duration=RESTED[name])
    end = played(registry, name, scene, "rotation", "sleeping")
    assert (end.linear_velocity[-1, 0, 0] == 0) == (name != "dart")


@pytest.mark.parametrize("name", ENGINES)
def test_a_fall_is_left_alone(lab: SimpleNamespace, registry: SimpleNamespace, name: str) -> None:
    """Fall to the bit as without sleeping."""
    scene = lab.scene(lab.ground(), lab.ball(position=(0.0, 0.0, 50.0), linear_velocity=(1.0, 0.0, 0.0)))
    one, two = played(registry, name, scene, *STAGES), played(registry, name, scene)
    for field in ("position", "orientation", "linear_velocity", "angular_velocity"):
        assert np.array_equal(getattr(one, field), getattr(two, field)), field


@pytest.mark.parametrize("name", ENGINES)
def test_a_driven_body_is_followed_after_rest(lab: SimpleNamespace, registry, name: str) -> None:
    """Drive a ball that has rested into a sleeping one, as without sleeping but for how far MuJoCo's may
    still have had to settle: by its speed at most, times the contact's 0.02 s."""
    rested = RESTED[name]
    hand = replace(lab.ball("hand", (0.0, 0.0, 0.0)), kind="driven")
    ways = ((-0.2, 0.0, 0.05), (-0.2, 0.0, 0.05), (0.3, 0.0, 0.05))
    tracker = Tracker("hand", (), (0.0, rested, rested + 1.0), ways, (UNTURNED,) * 3, ((),) * 3)
    bodies = lab.ground(), hand, lab.ball(position=(0.0, 0.0, 0.05))
    scene = lab.scene(*bodies, duration=rested + 1.0, trackers=(tracker,))
    one = played(registry, name, scene, *STAGES, "overlap_removal", "virtual_coupling")
    assert (one.linear_velocity[round(60 * (rested - 0.1)), 2] == 0).all()
    assert one.position[-1, 2, 0] > 0.3
    assert np.abs(one.position - played(registry, name, scene).position).max() < 0.02 * 1e-3


@pytest.mark.parametrize("asked", [None, PLANNED, STAGES])
def test_manifests_tell(lab: SimpleNamespace, registry: SimpleNamespace, asked: tuple | None) -> None:
    """Read back whether bodies may sleep: only where that was named, never with all effects."""
    scene, wanted = sliding(lab, SLOW, 1.0), asked == STAGES
    assert planned(scene, asked).on("sleeping") == wanted
    reported = {}
    for name in ENGINES:
        player = ready(registry.engine(name), scene, replace(registry.settings(name), effects=asked))
        reported[name] = player.world.describe().settings
        player.world.close()
    assert reported["dart"]["deactivation"] is reported["mujoco"]["sleep"] is wanted
    assert reported["dart"]["deactivation_time [s]"] == AFTER["dart"]
    assert reported["dart"]["deactivation_speed [m/s]"] == pytest.approx(10 * FASTEST["dart"])
    assert reported["mujoco"]["sleep_tolerance"] == FASTEST["mujoco"]
    assert reported["bullet"]["activationState (as set)"] == (1 if wanted else 2)


def test_the_reference_has_no_such_stage(lab: SimpleNamespace, registry: SimpleNamespace) -> None:
    """Slide on where sleeping is forced on, and say why."""
    scene = sliding(lab, SLOW, 0.5)
    one = record(registry.engine("reference"), scene, Settings("balanced", lab.frame, effects=STAGES))
    assert one.position[-1, 1, 0] == pytest.approx(SLOW * 0.5, rel=1e-9)
    reported = one.facts["effects"]["sleeping"]
    assert reported.startswith("forced on")
    assert reported.endswith("no such stage")
