"""Changed scenes: rotated, scaled, with boxes as hulls, with permuted pieces, or with one more body.

`transforms.py` has mirrored, translated and permuted scenes. All drop truths and expectations, which hold for
the original only.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.scenario import (
    IDENTITY,
    TRACKED,
    UNBOUNDED,
    BodyJoint,
    Box,
    Hull,
    Matrix,
    Quaternion,
    Scenario,
    Shape,
    Tracker,
    Vector,
    vector,
)
from touchstone.scenarios.solids import ball, box_corners
from touchstone.scenarios.transforms import Changes, each, mapped

FAR: Vector = (50.0, 50.0, 50.0)
"""Place of a body that nothing meets [m]."""
AROUND = 1.0
"""Time before the start and after the end of a scene that the path of its fixed bodies covers [s]: a cubic
spline departs from a parabola near its ends."""


def bare(scenario: Scenario, **fields: object) -> Scenario:
    """Scene without truths and expectations, and with other `fields`."""
    return replace(scenario, truths=(), forces=(), published=(), expectations=(), **fields)  # type: ignore[arg-type]


def rotated(scenario: Scenario, turn: Rotation) -> Scenario:
    """Scene turned about the origin as a whole, gravity and trackers included."""

    def there(v: Vector) -> Vector:
        return vector(turn.apply(v))

    def turned(q: Quaternion) -> Quaternion:
        w, x, y, z = (turn * Rotation.from_quat(q, scalar_first=True)).as_quat(scalar_first=True).tolist()
        return (w, x, y, z)

    changes: Changes = {
        **dict.fromkeys(("position", "linear_velocity", "angular_velocity"), there),
        **dict.fromkeys(("anchor", "axis", "gravity"), there),
        "orientation": turned,
        "positions": each(there),
        "orientations": each(turned),
        **dict.fromkeys(("pieces", "joints"), tuple),
    }
    bodies = tuple(one if one.kind in TRACKED else mapped(one, changes) for one in scenario.bodies)
    found: Scenario = mapped(bare(scenario), changes, bodies=bodies)
    return found


def heavier(scenario: Scenario, factor: float) -> Scenario:
    """Scene with all masses, inertias and couplings times `factor`: nothing else moves."""

    def times(value: float) -> float:
        return value * factor

    coupling: Changes = dict.fromkeys(("stiffness", "damping"), times)
    changes: Changes = {
        **coupling,
        "mass": times,
        "inertia": lambda inertia: _times(inertia, factor),
        "largest_force": lambda most: times(most) if most < UNBOUNDED else most,
        "trackers": each(lambda one: one if scenario.prescribes(one) else mapped(one, coupling)),
    }
    found: Scenario = mapped(bare(scenario), changes)
    return found


def rescaled(scenario: Scenario, times: float) -> Scenario:
    """Scene of `similar` whose duration and displayed frames are `times` as long, too.

    Raises:
        ValueError: the frame rate over `times` is not a whole number.
    """
    rate = scenario.frame_rate / times
    if rate != round(rate):
        raise ValueError(f"frame rate {scenario.frame_rate}: expected a multiple of {times:g}")
    return similar(scenario, times, duration=scenario.duration * times, frame_rate=round(rate))


def similar(scenario: Scenario, times: float, **fields: object) -> Scenario:
    """Scene whose lengths are `times`^2 as large and whose motion takes `times` as long, under the same
    gravity (Froude's law), and with other `fields`: speeds are `times` as high. Powers of two scale exactly.
    """
    size = times * times

    def lengths(v: Vector) -> Vector:
        return _scaled(v, size)

    def speeds(v: Vector) -> Vector:
        return _scaled(v, times)

    def rates(v: Vector) -> Vector:
        return _scaled(v, 1 / times)

    travel = {one.name: size if one.type == "slider" else 1.0 for one in scenario.body_joints}
    changes: Changes = {
        **dict.fromkeys(("position", "center_of_mass", "half_extents", "half_axes"), lengths),
        **dict.fromkeys(("radius", "half_length"), lambda length: length * size),
        **dict.fromkeys(("rolling_friction", "torsional_friction"), lambda length: length * size),
        **dict.fromkeys(("linear_velocity", "surface_velocity"), speeds),
        **dict.fromkeys(("angular_velocity", "surface_angular_velocity"), rates),
        "vertices": each(lengths),
        "inertia": lambda inertia: _times(inertia, size * size),
        "trackers": each(lambda one: _rescaled_tracker(one, size, times, not scenario.prescribes(one))),
        "body_joints": each(
            lambda one: _rescaled_joint(one, travel[one.name] / travel[one.mimics or one.name], size, times)
        ),
    }
    found: Scenario = mapped(bare(scenario), changes, **fields)
    return found


def _rescaled_joint(one: BodyJoint, coupled: float, size: float, times: float) -> BodyJoint:
    """Joint of a scene whose masses stay: forces stay, torques are `size` times as large; `coupled`: what
    the ratio of its coupling becomes of 1."""
    length = size if one.type == "slider" else 1.0
    scale = size / length

    def bound(value: float, factor: float) -> float:
        return value * factor if abs(value) < UNBOUNDED else value

    return replace(
        one,
        anchor=_scaled(one.anchor, size),
        lower=bound(one.lower, length),
        upper=bound(one.upper, length),
        stiffness=one.stiffness * scale / length,
        damping=one.damping * times * scale / length,
        target=one.target * length,
        target_rate=one.target_rate * length / times,
        largest_force=bound(one.largest_force, scale),
        ratio=one.ratio * coupled,
    )


def _rescaled_tracker(one: Tracker, size: float, times: float, coupled: bool) -> Tracker:
    moved = replace(
        one,
        times=tuple(times * t for t in one.times),
        positions=tuple(_scaled(p, size) for p in one.positions),
    )
    if not coupled:
        return moved
    return replace(
        moved,
        stiffness=one.stiffness / times**2,
        damping=one.damping / times,
        hinge_frequency=one.hinge_frequency / times,
    )


def with_hulls(scenario: Scenario) -> Scenario:
    """Scene with every box of bodies that are not fixed as the hull of its eight corners."""

    def hull(shape: Shape) -> Shape:
        return Hull(box_corners(shape.half_extents)) if isinstance(shape, Box) else shape

    bodies = tuple(one if one.kind == "fixed" else mapped(one, {"shape": hull}) for one in scenario.bodies)
    return bare(scenario, bodies=bodies)


def with_stranger(scenario: Scenario) -> Scenario:
    """Scene with one more ball, far from everything and at rest where there is no gravity."""
    material = scenario.bodies[0].material
    return bare(scenario, bodies=(*scenario.bodies, ball("stranger", material, 0.05, 1.0, FAR)))


def carried(scenario: Scenario, speed: Vector, push: Vector = (0.0, 0.0, 0.0)) -> Scenario:
    """Scene on fixed bodies that move with a velocity [m/s] and an acceleration [m/s^2], which is added to
    gravity: Galilei's principle, and the equivalence of acceleration and gravity."""
    before = round(AROUND * scenario.frame_rate)
    frames = np.arange(-before, scenario.frame_count + before + 1)
    times = frames / scenario.frame_rate
    way = np.outer(times, speed) + np.outer(times**2 / 2, push)
    bodies, trackers = [], []
    for one in scenario.bodies:
        if one.kind == "fixed":
            count = len(times)
            path = tuple(map(vector, way + one.position))
            keys = (tuple(times.tolist()), path, (one.orientation,) * count, ((),) * count)
            trackers.append(Tracker(one.name, (), *keys, interpolation="cubic"))
            one = replace(one, kind="prescribed", position=(0.0, 0.0, 0.0), orientation=IDENTITY)
        else:
            one = replace(one, linear_velocity=vector(np.add(one.linear_velocity, speed)))
        bodies.append(one)
    gravity = vector(np.add(scenario.gravity, push))
    return bare(scenario, bodies=tuple(bodies), trackers=tuple(trackers), gravity=gravity)


def can_be_carried(scenario: Scenario) -> bool:
    """Whether a scene has fixed bodies, and neither trackers nor joints with the world."""
    hangs = any(not joint.parent for joint in scenario.body_joints)
    return not (scenario.trackers or hangs) and any(body.kind == "fixed" for body in scenario.bodies)


def later(scenario: Scenario, frames: int) -> Scenario:
    """Scene whose trackers hold their first pose for some displayed frames before they move."""
    wait = frames / scenario.frame_rate
    trackers = tuple(
        replace(
            one,
            times=(0.0, *(wait + t for t in one.times)),
            positions=(one.positions[0], *one.positions),
            orientations=(one.orientations[0], *one.orientations),
            angles=(one.angles[0], *one.angles),
        )
        for one in scenario.trackers
    )
    return bare(scenario, trackers=trackers, duration=scenario.duration + wait)


def starts_at_rest(scenario: Scenario) -> bool:
    """Whether a scene has trackers, none of which moves in its first frame, and no body has a velocity."""
    first = 1 / scenario.frame_rate
    still = all(
        len({one.positions[k], one.positions[0]}) == 1
        and len({one.orientations[k], one.orientations[0]}) == 1
        and len({one.angles[k], one.angles[0]}) == 1
        for one in scenario.trackers
        for k, time in enumerate(one.times)
        if time <= first
    )
    moves = any(any(body.linear_velocity) or any(body.angular_velocity) for body in scenario.bodies)
    return bool(scenario.trackers) and still and not moves


def pieces_reversed(scenario: Scenario) -> Scenario:
    """Scene with the pieces of each body in reverse order."""
    return bare(
        scenario, bodies=tuple(replace(one, pieces=tuple(reversed(one.pieces))) for one in scenario.bodies)
    )


def _scaled(v: Vector, factor: float) -> Vector:
    return (v[0] * factor, v[1] * factor, v[2] * factor)


def _times(m: Matrix, factor: float) -> Matrix:
    return (_scaled(m[0], factor), _scaled(m[1], factor), _scaled(m[2], factor))
