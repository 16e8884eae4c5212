"""Measure what changes if what the paper leaves open is decided otherwise than in `reference_impl/paper`.

    .venv/bin/python tests/shared/paper_choices.py

prints the table of docs/method.md: short scenes, played with the choice and with an alternative. Arguments:
names in FIGURES (default: all). The kernels run as plain Python, so that assigning another function to the
name under which a caller finds a kernel replaces it.
"""

import os
import re
import sys
from contextlib import ExitStack
from functools import partial
from unittest.mock import patch

import paper_scenes as scenes

from touchstone.reference_impl.core.conventions import PART_WHOLE
from touchstone.reference_impl.core.kernel import JIT
from touchstone.reference_impl.kinematics.skeleton import move_from_shown, store_shown
from touchstone.reference_impl.paper import attraction, ccd_ik, frame, impulses, integration
from touchstone.reference_impl.paper import overlap_avoidance as avoidance
from touchstone.reference_impl.paper import penetration_depth as depth
from touchstone.reference_impl.paper import virtual_coupling as coupling

TABLE = """
| decision | choice | alternative | what changes: choice vs alternative |
| --- | --- | --- | --- |
| motion of the tracker within a frame (`virtual_coupling.follow_tracker`) | linear
  | jumps at the frame's start | lag behind a tracker at 1 m/s: {tracker} |
| rotation of the coupling (`virtual_coupling.follow_tracker`) | Eq. 6 for the rotation vector | the tracker's
  | lag of a turn at 10 rad/s: {turn} |
| integration of Eq. 6 (`virtual_coupling.coupled`) | closed form | semi-implicit Euler
  | distance 0.5 s after the tracker jumped by 10 cm: {light} at 0.05 kg, {critical} at 0.4 kg |
| speed of the attraction (`attraction.attract`) | 0.1 s | at once
  | largest turn of a hinge in a frame: {arms} in `two_arms`, {corner} in `corner_slide` |
| velocity of a link in contacts (`frame.update_driven_objects`) | of coupling and attraction
  | of the resolved poses | way and highest speed of the box in the first 2 s of `push_box`: {link} |
| end of translation (`overlap_avoidance.translate_out`) | after 32 rounds | after 4 rounds
  | frames with step 4, ball 2 cm in a square corner: {rounds} |
| end of step 4 (`penetration_depth.return_to_free_state`) | at the nearest free state
  | at the last free state | distance from a narrow slot of a ball that arrives at 3 m/s: {back} |
| angle of "almost parallel" (`overlap_avoidance.PARALLEL_COSINE`) | 10 deg | 0: no special case
  | frames with step 4 in `corner_slide`: {parallel} |
| sign of Eq. 5 (`ccd_ik.joint_rotation`) | about the axis | always positive
  | frames with step 4 in `two_arms`: {sign} |
| what a collision is (`frame._first_collision`) | first overlap, by bisection
  | overlap at the frame's end | depth at impact after a fall of 0.5 m: {collision} |
| resting contacts (`frame.update_simulated_objects`) | no bounce by gravity alone | always e
  | range of heights of a ball at rest, e = 0.5: {rest} |
| what an impulse on a link moves (`impulses`) | the whole object, by the mass of Eq. 6 | nothing
  | most impulses in a frame, ball between hand and wall: {mass} |
| order of impulses (`impulses.resolve_collisions`) | fastest approach first | slowest first
  | impulses in `break_15` and highest speed after it: {order} |
| the same, of equal speeds (`impulses.resolve_collisions`) | first pair first | last pair first
  | middle one of three balls, hit from both sides at 4 m/s, e = 0.5: {ties} |
| point of a contact (`impulses.contact_point`) | middle of both deepest points | on A
  | spin of a ball that fell and rolls: {point} |
| integration of motion (`integration`) | gravity before the motion | after it
  | height over the parabola after a fall of 1 s: {fall} |
| the same | gravity before the motion | half before, half after | the same: {halves} |
| integration of rotation (`integration`) | midpoint rule | spin at the start
  | largest error of energy of a tumbling box in 10 s: {spin} |
"""
"""A row goes on in the lines that begin with a space."""

follow, update, resolve = coupling.follow_tracker, frame.update_driven_objects, impulses.resolve_collisions
accelerate, begin_motion, end_motion = (
    integration.accelerate,
    integration.begin_motion,
    integration.end_motion,
)
mobility, apply_impulse, rotation = impulses.mobility, impulses.apply_impulse, ccd_ik.joint_rotation


def follow_jumping(driver, h):
    """Eq. 6 about a tracker that is at the end of its motion from the frame's start."""
    for name in ("position", "orientation"):
        driver[f"old_target_{name}"] = driver[f"target_{name}"]
    follow(driver, h)


def follow_turned(driver, h):
    """Eq. 6 in translation, and the tracker's orientation."""
    follow(driver, h)
    driver["orientation"] = driver["target_orientation"]


def euler_step(x, x_rate, k, r, h):
    """Eq. 6 by a step of semi-implicit Euler."""
    x_rate -= h * (k * x + r * x_rate)
    return x + h * x_rate, x_rate


def update_from_shown(world):
    """Lower loop that stores the poses before it."""
    for driver in world.drivers:
        store_shown(world.bodies, world.joints, driver)
    update(world)


def back_to_free_state(world, d):
    """Step 4 all the way to the last free state."""
    depth.interpolate(world.bodies, world.joints, world.drivers[d], PART_WHOLE, 0.0)
    return True


def resolver(pick):
    """`resolve_collisions` by the impulses that `pick` chooses among (speed, index) of what approaches."""

    def resolve_picked(world, end, time, bounce):
        for _ in range(impulses.IMPULSES_AT_ONCE):
            speeds = [(-impulses.normal_velocity(world.bodies, world.pairs[k]), k) for k in range(end)]
            closing = [one for one in speeds if one[0] > impulses.APPROACH_LEAST]
            if not closing:
                return True
            pair = world.pairs[pick(closing)[1]]
            impulses.collide(world, pair, time, bounce * pair["restitution"])
        return False

    return resolve_picked


def gravity_after(share):
    """Patches by which a share of gravity acts after the motion, in frames without collisions."""

    def end(bodies):
        end_motion(bodies)
        accelerate(bodies, (0.0, 0.0, -scenes.GRAVITY), share * scenes.FRAME)

    def begin(bodies, gravity, h):
        accelerate(bodies, gravity, (1 - share) * h)

    return (frame, "accelerate", begin), (frame, "end_motion", end)


def begin_at_spin(bodies, h):
    """`begin_motion` without the midpoint: objects turn at the spin that they have."""
    spin = bodies["omega"].copy()
    begin_motion(bodies, h)
    bodies["omega"] = spin


def unless_driven(function, body_of, result):
    """A kernel of `impulses` that gives `result` for links of driven objects."""
    return lambda *given: result if body_of(*given)["driver"] >= 0 else function(*given)


IMMOVABLE = (
    (impulses, "mobility", unless_driven(mobility, lambda body, *_: body, (0.0, 0.0))),
    (impulses, "apply_impulse", unless_driven(apply_impulse, lambda world, b, *_: world.bodies[b], None)),
)
RESOLVED_POSES = (
    (frame, "update_driven_objects", update_from_shown),
    (frame, "move_links", lambda *links: move_from_shown(*links, scenes.FRAME)),
)
AT_THE_END = (
    (frame, "_first_collision", lambda world, found, h: h),
    (frame, "translate_out", lambda world, kind: None),
)
AT_ONCE, EULER = (attraction, "ATTRACTION_TIME", 1e-9), (coupling, "coupled", euler_step)
FIGURES = {
    "tracker": (scenes.lag, (frame, "follow_tracker", follow_jumping)),
    "turn": (scenes.turn_lag, (frame, "follow_tracker", follow_turned)),
    "light": (partial(scenes.settled, 0.05), EULER),
    "critical": (partial(scenes.settled, 0.4), EULER),
    "arms": (partial(scenes.largest_turn, "two_arms"), AT_ONCE),
    "corner": (partial(scenes.largest_turn, "corner_slide"), AT_ONCE),
    "link": (scenes.pushed, *RESOLVED_POSES),
    "rounds": (scenes.cornered, (avoidance, "TRANSLATION_ROUNDS", 4)),
    "back": (scenes.slot_gap, (avoidance, "return_to_free_state", back_to_free_state)),
    "parallel": (partial(scenes.gone_back, "corner_slide"), (avoidance, "PARALLEL_COSINE", 0.0)),
    "sign": (
        partial(scenes.gone_back, "two_arms"),
        (ccd_ik, "joint_rotation", lambda *given: abs(rotation(*given))),
    ),
    "collision": (scenes.impact_depth, *AT_THE_END),
    "rest": (scenes.jitter, (frame, "resolve_collisions", lambda *given: resolve(*given[:3], 1.0))),
    "mass": (scenes.squeezed, *IMMOVABLE),
    "order": (scenes.broken, (frame, "resolve_collisions", resolver(min))),
    "ties": (scenes.middle_speed, (frame, "resolve_collisions", resolver(max))),
    "point": (scenes.rolling_spin, (impulses, "contact_point", lambda pair: tuple(pair["point_a"]))),
    "fall": (scenes.fall_error, *gravity_after(1.0)),
    "halves": (scenes.fall_error, *gravity_after(0.5)),
    "spin": (scenes.energy_error, (frame, "begin_motion", begin_at_spin)),
}
"""Name in TABLE -> function that measures, and patches that make the alternative."""


def compared(name: str) -> str:
    """A figure with the choice and with the alternative."""
    figure, *patches = FIGURES[name]
    chosen = figure()
    with ExitStack() as stack:
        for one in patches:
            stack.enter_context(patch.object(*one))
        return f"{chosen} vs {figure()}"


def main(names: list[str]) -> None:
    """Print the rows whose figures have these names, or the whole table."""
    for row in TABLE.strip().replace("\n  ", " ").splitlines():
        wanted = re.findall(r"\{(\w+)\}", row)
        if not names or set(wanted) & set(names):
            print(row.format_map({name: compared(name) for name in wanted}), flush=True)


if __name__ == "__main__":
    if JIT:
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, "NUMBA_DISABLE_JIT": "1"})
    main(sys.argv[1:])
