"""Checks of states: the start, frames of reference, the step, gravity, repetition, and driven bodies."""

from collections.abc import Iterator
from dataclasses import replace
from math import inf

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.conformance import scenes
from touchstone.adapters.conformance.bench import Bench, Snapshot
from touchstone.adapters.contract import Array
from touchstone.scenarios.scenario import Scenario, vector

ROUNDING = 1e-5
"""Error of a state at the start [m, 1, m/s, rad/s]: single precision."""
SHARE = 0.02
"""Relative error of a step or of gravity from which it counts as another [1]."""
STEPS = 24
"""Steps of a free motion."""
FOLLOWED = 0.05
"""Distance [m] and angle [rad] from its tracker at which a driven body has not followed it."""


def start(bench: Bench) -> Iterator[str]:
    """The first state is that of the scene, each quantity in the frame of the contract."""
    asked = (scenes.spinning_ball(), scenes.offset_box())
    yield from bench.each(asked, lambda scenario: _start(scenario, bench.play(scenario, 0)[0]))


def _start(scenario: Scenario, seen: Snapshot) -> Iterator[str]:
    body = scenario.bodies[0]
    name = repr(body.name)
    turn = Rotation.from_quat(np.array(body.orientation), scalar_first=True)
    arm, omega = turn.apply(body.center_of_mass), np.array(body.angular_velocity)
    place, moved = np.array(body.position), np.array(body.linear_velocity)
    if not _near(seen.position[0], place):
        if _near(seen.position[0], place + arm):
            yield f"position of {name} is that of its mass centre; the contract wants that of its origin"
        else:
            yield f"position of {name} at the start is {_text(seen.position[0])}, asked {_text(place)}"
    asked, found = np.array(body.orientation), seen.orientation[0]
    if not (_near(found, asked) or _near(found, -asked)):
        if _near(np.roll(found, 1), asked) or _near(np.roll(found, 1), -asked):
            yield f"orientation of {name} is xyzw; the contract wants wxyz"
        elif _near(found * [1, -1, -1, -1], asked):
            yield f"orientation of {name} is that of the world in the body; the contract wants the reverse"
        else:
            yield f"orientation of {name} at the start is {_text(found)}, asked {_text(asked)}"
    if not _near(seen.linear_velocity[0], moved):
        if _near(seen.linear_velocity[0], moved - np.cross(omega, arm)):
            yield f"linear velocity of {name} is that of its origin; the contract wants its mass centre's"
        elif _near(turn.apply(seen.linear_velocity[0]), moved):
            yield f"linear velocity of {name} is along the body's axes; the contract wants the world's"
        else:
            yield f"linear velocity of {name} is {_text(seen.linear_velocity[0])}, asked {_text(moved)}"
    if not _near(seen.angular_velocity[0], omega):
        if _near(turn.apply(seen.angular_velocity[0]), omega):
            yield f"angular velocity of {name} is along the body's axes; the contract wants the world's"
        else:
            yield f"angular velocity of {name} is {_text(seen.angular_velocity[0])}, asked {_text(omega)}"


def order(bench: Bench) -> Iterator[str]:
    """Rows of the state are in the scenario's order."""
    scenario = scenes.meeting_balls()
    places = np.array([[-1.0, 0.0, 3.0], [2.0, 0.0, 3.0]])
    bodies = tuple(
        replace(body, position=vector(place), linear_velocity=(0.0, 0.0, 0.0))
        for body, place in zip(scenario.bodies, places)
    )
    seen = bench.play(replace(scenario, bodies=bodies), 0)[0]
    if _near(seen.position, places[::-1]):
        yield "bodies are read in another order than the scene's: 'two' stands in the row of 'one'"


def step(bench: Bench) -> Iterator[str]:
    """A step advances by the asked time, and gravity acts as asked."""
    free = scenes.spinning_ball()
    seen = bench.play(free, STEPS)
    velocity = np.array(free.bodies[0].linear_velocity)
    time = float((seen[-1].position[0] - seen[0].position[0]) @ velocity / (velocity @ velocity)) / STEPS
    if abs(time / bench.dt - 1) > SHARE:
        yield f"a step advances by {time:.4g} s, asked {bench.dt:.4g} s"
    slowed = float(np.linalg.norm(seen[-1].linear_velocity[0]) / np.linalg.norm(velocity))
    if abs(slowed - 1) > 1e-3:
        yield f"a ball in free flight keeps {slowed:.4f} of its speed in {STEPS} steps: something damps it"
    turned = Rotation.from_quat(seen[-1].orientation[0], scalar_first=True)
    turned = turned * Rotation.from_quat(seen[0].orientation[0], scalar_first=True).inv()
    asked = np.array(free.bodies[0].angular_velocity) * bench.dt * STEPS
    if not np.allclose(turned.as_rotvec(), asked, atol=SHARE * float(np.linalg.norm(asked))):
        way = _text(turned.as_rotvec())
        yield f"a ball that spins turns by {way} rad in {STEPS} steps, asked {_text(asked)}"
    fall = bench.play(scenes.falling_ball(), STEPS)[-1].linear_velocity[0] / (STEPS * bench.dt)
    wanted = np.array([0.0, 0.0, -9.81])
    if np.linalg.norm(fall - wanted) > SHARE * 9.81:
        yield f"gravity is {_text(fall)} m/s^2, asked {_text(wanted)}"


def repetition(bench: Bench) -> Iterator[str]:
    """Reads change nothing, a run repeats to the bit, and worlds do not share a state."""
    scenario = scenes.landing_ball()
    once, again = bench.play(scenario, STEPS), bench.play(scenario, STEPS)
    if not all(one.equals(two) for one, two in zip(once, again)):
        yield "two runs of one scene differ: it is not deterministic, or keeps something between worlds"
        return
    if not once[-1].equals(bench.play(scenario, STEPS, reads=3)[-1]):
        yield "reads change the state: a run that is read three times a step ends elsewhere"
    with bench.world(scenario) as world, bench.world(scenes.falling_ball()) as other:
        for k in range(STEPS):
            world.drive(k)
            world.step()
            other.drive(k)
            other.step()
        if not bench.read(world, scenario).equals(once[-1]):
            yield "worlds share a state: a second world changes the motion in the first"


def driven(bench: Bench) -> Iterator[str]:
    """A driven body follows its tracker; its hinges are in the tracker's order, with the tracker's signs."""
    scenario = scenes.finger()
    steps = round(scenario.duration / bench.dt)
    seen = bench.play(scenario, steps)
    if seen[0].joint_angle.shape != (2,):
        return
    asked = np.array(scenario.trackers[0].angles[-1])
    found = seen[-1].joint_angle
    if np.abs(found - asked).max() > FOLLOWED:
        if np.abs(found[::-1] - asked).max() <= FOLLOWED:
            yield "hinges are read in another order than the tracker's"
        elif np.abs(found + asked).max() <= FOLLOWED:
            yield "hinges turn the wrong way: at the tracker's angle q they are at -q"
        else:
            yield f"hinges end at {_text(found)} rad, their tracker at {_text(asked)}"
    place, wanted = seen[-1].position[0], np.array(scenario.trackers[0].positions[-1])
    if np.linalg.norm(place - wanted) > FOLLOWED:
        yield f"the driven root ends at {_text(place)} m, its tracker at {_text(wanted)}"
    middle = seen[steps // 4]
    if np.linalg.norm(middle.position[0] - seen[0].position[0]) < 1e-3:
        yield "the driven root does not move before the middle of its path"


def finite(bench: Bench) -> Iterator[str]:
    """All that is read is finite."""
    for scenario in (scenes.landing_ball(), scenes.meeting_balls()):
        for seen in bench.play(scenario, 4):
            for name in ("position", "orientation", "linear_velocity", "angular_velocity"):
                if not np.isfinite(getattr(seen, name)).all():
                    yield f"{name} is not finite in {scenario.name}"
                    return
            if not np.isfinite(seen.contacts["impulse"]).all():
                yield f"an impulse is not finite in {scenario.name}"
                return


def _near(found: Array, asked: Array, within: float = ROUNDING) -> bool:
    return (
        bool(np.abs(found - asked).max(initial=0.0) <= within) if np.isfinite(found).all() else within == inf
    )


def _text(values: Array) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in np.asarray(values).ravel() + 0.0) + ")"
