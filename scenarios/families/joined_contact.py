"""Joined bodies in contact: a gripper, carts, a cradle on rods, a ragdoll; and a ladder."""

from math import cos, hypot, pi, radians, sin, sqrt
from typing import Any

import numpy as np
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.families.literature import even
from touchstone.scenarios.families.mechanisms import (
    ACROSS,
    PERIOD,
    direction,
    mechanism,
    pendulum_length,
)
from touchstone.scenarios.orientations import quaternion
from touchstone.scenarios.scenario import (
    GRAVITY,
    ORIGIN,
    Arc,
    Body,
    BodyJoint,
    Box,
    Expectation,
    Piece,
    Quaternion,
    Scenario,
    Truth,
    Vector,
    vector,
)
from touchstone.scenarios.solids import ball, block, capsule, cylinder, slab
from touchstone.scenarios.truths.force_truth import ForceTruth
from touchstone.scenarios.truths.published import Published

HALF, MASS, MU = 0.05, 1.0, 0.5
"""Half edge [m] and mass [kg] of a gripped cube, and its friction."""
FINGER = (0.02, 0.03, 0.04)
"""Half extents of a finger [m]."""
FINGERS, WRIST = 0.2, 1.0
"""Masses of a finger and of the wrist [kg]."""


@scene
def gripper() -> tuple[Scenario, ...]:
    """Fingers on motorised sliders squeeze a cube, and a wrist on a slider lifts them: friction holds up to
    2 mu N.

    At 20 N it holds twice the weight; at 8 N eight tenths of it: the fingers slip off and the cube stays.
    """
    return (
        _gripper("gripper_lifts", 20.0, 0.3, MASS * GRAVITY, 2.0, True),
        _gripper("gripper_slips", 8.0, 0.05, 2 * MU * 8.0, 1.0, False),
    )


def _gripper(name: str, squeeze: float, pace: float, load: float, duration: float, lifts: bool) -> Scenario:
    """A gripper of whose motor the force, bound by its largest, gives an even acceleration [m/s2] under the
    load of the cube [N]."""
    moved = WRIST + 2 * FINGERS
    lifted = moved + (MASS if lifts else 0.0)
    pull = moved * GRAVITY + load + lifted * pace
    wrist = block("wrist", "rubber", (0.1, 0.05, 0.03), WRIST, (0.0, 0.0, 0.3))
    cube = block("cube", "rubber", (HALF,) * 3, MASS, (0.0, 0.0, HALF))
    # motors ask for more than their largest force
    strong: dict[str, Any] = {"damping": 1000.0, "target_rate": 10.0}
    up = (0.0, 0.0, 1.0)
    bodies = [wrist]
    joints = [BodyJoint("lift", "slider", "", "wrist", wrist.position, up, largest_force=pull, **strong)]
    for side, finger in ((1.0, "right"), (-1.0, "left")):
        place, inward = (side * (HALF + FINGER[0]), 0.0, 0.02 + FINGER[2]), (-side, 0.0, 0.0)
        bodies.append(block(finger, "rubber", FINGER, FINGERS, place))
        joints.append(
            BodyJoint(
                f"slider_{finger}", "slider", "wrist", finger, place, inward, largest_force=squeeze, **strong
            )
        )
    rise = (0.0, 0.0, pace)
    truths = [Truth(body.name, "arcs", (Arc(0.0, body.position, acceleration=rise),)) for body in bodies]
    truths.append(Truth("cube", "arcs", (Arc(0.0, cube.position, acceleration=rise if lifts else ORIGIN),)))
    return mechanism(
        name,
        f"two fingers squeeze a cube with {squeeze:g} N and {'lift' if lifts else 'cannot lift'} it",
        [slab("table", "rubber"), *bodies, cube],
        joints,
        duration,
        coefficients=even("rubber", mu=MU),
        truths=tuple(truths),
        forces=tuple(ForceTruth(one, "cube", 0.5, duration, squeeze) for one in ("right", "left")),
        expectations=(Expectation("leave", "cube", "table", 0.0, 0.5),) if lifts else (),
    )


WHEEL = (0.1, 0.03)
"""Radius and half length of a wheel [m]."""
CHASSIS, WHEEL_MASS = 4.0, 0.5
"""Masses of the chassis and of each of its four wheels [kg]."""
WHOLE = CHASSIS + 4 * WHEEL_MASS


def _cart(turn: Rotation, spin: float = 0.0, **motor: Any) -> tuple[list[Body], list[BodyJoint]]:
    """A chassis and four wheels on a plane through the origin, with hinges across."""
    up, axis = np.array((0.0, 0.0, WHEEL[0])), vector(turn.apply(ACROSS))
    chassis = block(
        "chassis", "rubber", (0.35, 0.15, 0.03), CHASSIS, vector(turn.apply(up)), quaternion(turn)
    )
    bodies, joints = [chassis], []
    for x, end in ((0.25, "front"), (-0.25, "rear")):
        for y, side in ((0.2, "left"), (-0.2, "right")):
            place, name = vector(turn.apply(up + (x, y, 0.0))), f"{end}_{side}"
            lying = quaternion(turn * Rotation.from_rotvec((-pi / 2, 0.0, 0.0)))
            spun = vector(spin * np.array(axis))
            bodies.append(cylinder(name, "rubber", *WHEEL, WHEEL_MASS, place, lying, spin=spun))
            joints.append(BodyJoint(name, "hinge", "chassis", name, place, axis, **motor))
    return bodies, joints


@scene
def cart_slope() -> Scenario:
    """A cart on four wheels rolls down a slope at g sin / (1 + 4 I / (m r^2)), m the mass of all."""
    turn = Rotation.from_rotvec((0.0, radians(10.0), 0.0))
    bodies, joints = _cart(turn)
    inertia, radius = WHEEL_MASS * WHEEL[0] ** 2 / 2, WHEEL[0]
    pace = GRAVITY * sin(radians(10.0)) / (1 + 4 * inertia / (WHOLE * radius**2))
    along = vector(pace * turn.apply((1.0, 0.0, 0.0)))
    turning = vector(pace / radius * turn.apply(ACROSS))
    truths = tuple(
        Truth(
            body.name,
            "arcs",
            (
                Arc(
                    0.0, body.position, acceleration=along, angular_acceleration=ORIGIN if k == 0 else turning
                ),
            ),
        )
        for k, body in enumerate(bodies)
    )
    up = vector(turn.apply((0.0, 0.0, 1.0)))
    slope = slab("slope", "rubber", up, quaternion(turn))
    pairs, summary = even("rubber", mu=0.5), "a cart on four wheels rolls down a slope"
    return mechanism("cart_slope", summary, [slope, *bodies], joints, 2.0, coefficients=pairs, truths=truths)


@scene
def wheel_motor() -> Scenario:
    """Four motors hold wheels at 10 rad/s: a cart slips off at mu g until it rolls at 1 m/s.

    Friction of mu m g / 4 slows each wheel by 0.2 %, which is left out of the truth of the chassis.
    """
    rate, damping, mu = 10.0, 20.0, 0.3
    slow = mu * WHOLE * GRAVITY / 4 * WHEEL[0] / damping
    bodies, joints = _cart(Rotation.identity(), rate - slow, damping=damping, target_rate=rate)
    start, speed, pull = bodies[0].position, rate * WHEEL[0], mu * GRAVITY
    rolls = speed / pull
    slips = Arc(0.0, start, acceleration=(pull, 0.0, 0.0))
    even_one = Arc(rolls, vector(np.add(start, (speed * rolls / 2, 0.0, 0.0))), (speed, 0.0, 0.0))
    return mechanism(
        "wheel_motor",
        "a cart with driven wheels slips off, then rolls",
        [slab("floor", "rubber"), *bodies],
        joints,
        2.0,
        coefficients=even("rubber", mu=mu),
        truths=(Truth("chassis", "arcs", (slips, even_one)),),
    )


@scene
def skid_steer() -> Scenario:
    """Motors drive the balls of one side against those of the other: a vehicle turns on the spot.

    Balls at (x, y) slip along and across their way. The moments of both forces cancel, so of f = mu m g / 4
    they get F = f x / sqrt(x^2 + y^2) along it, and slip in that direction: a ball spins at s = rate - F r /
    damping, and the vehicle turns at s r y / (x^2 + y^2).
    """
    x, y, radius, rate, damping, mu = 0.3, 0.3, 0.05, 10.0, 0.5, 0.5
    along = mu * WHOLE * GRAVITY / 4 * x / hypot(x, y)
    spin = rate - along * radius / damping
    turn = spin * radius * y / (x * x + y * y)
    place, turns = (0.0, 0.0, radius), (0.0, 0.0, turn)
    bodies, joints = [block("chassis", "rubber", (0.3, 0.2, 0.02), CHASSIS, place, spin=turns)], []
    for k, (front, left) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        name, at = f"ball_{k + 1}", (front * x, left * y, radius)
        way, turned = (-turn * left * y, turn * front * x, 0.0), (0.0, -left * spin, turn)
        bodies.append(ball(name, "rubber", radius, WHEEL_MASS, at, way, turned))
        motor = BodyJoint(
            name, "hinge", "chassis", name, at, ACROSS, damping=damping, target_rate=-left * rate
        )
        joints.append(motor)
    return mechanism(
        "skid_steer",
        "a vehicle turns on the spot by motors of both sides",
        [slab("floor", "rubber"), *bodies],
        joints,
        2.0,
        coefficients=even("rubber", mu=mu),
        truths=(Truth("chassis", "arcs", (Arc(0.0, place, angular_velocity=turns),)),),
    )


ROW, BOB = 5, 0.05
"""Number of balls of the cradle, and their radius [m]."""


@scene
def cradle_rods() -> Scenario:
    """Five balls on hinges, the first raised by 30 degrees, which meets the second after T / 4."""
    angle = radians(30.0)
    length = pendulum_length(angle)
    arm = (length + sqrt(length**2 - 8 / 5 * BOB**2)) / 2
    bodies, joints = [], []
    for k in range(ROW):
        name, anchor = f"ball_{k + 1}", (2 * BOB * k, 0.0, 0.0)
        raised = angle if k == 0 else 0.0
        place = (anchor[0] - arm * sin(raised), 0.0, -arm * cos(raised))
        bodies.append(ball(name, "steel", BOB, 1.0, place))
        joints.append(BodyJoint(f"rod_{k + 1}", "hinge", "", name, anchor, ACROSS))
    meets = Expectation("touch", "ball_1", "ball_2", PERIOD / 4 - 0.02, PERIOD / 4 + 0.02)
    return mechanism(
        "cradle_rods",
        "Newton's cradle on rods",
        bodies,
        joints,
        3.0,
        coefficients=even("steel", mu=0.0, e=1.0),
        truths=(),
        expectations=(meets,),
    )


STEP = (0.3, 0.18)
"""Depth and height of a stair [m]."""
LIMBS: dict[str, tuple[str, Vector, Vector, float, float, str]] = {
    "head": ("torso", (0.0, 0.0, 0.35), (0.0, 0.0, 0.6), 0.1, 5.0, "ball"),
    "upper_arm_left": ("torso", (0.0, 0.2, 0.27), (0.0, 0.5, 0.27), 0.045, 2.0, "ball"),
    "upper_arm_right": ("torso", (0.0, -0.2, 0.27), (0.0, -0.5, 0.27), 0.045, 2.0, "ball"),
    "forearm_left": ("upper_arm_left", (0.0, 0.5, 0.27), (0.0, 0.8, 0.27), 0.04, 1.5, "hinge"),
    "forearm_right": ("upper_arm_right", (0.0, -0.5, 0.27), (0.0, -0.8, 0.27), 0.04, 1.5, "hinge"),
    "thigh_left": ("torso", (0.0, 0.1, -0.25), (0.0, 0.1, -0.65), 0.07, 8.0, "ball"),
    "thigh_right": ("torso", (0.0, -0.1, -0.25), (0.0, -0.1, -0.65), 0.07, 8.0, "ball"),
    "shin_left": ("thigh_left", (0.0, 0.1, -0.65), (0.0, 0.1, -1.05), 0.05, 4.0, "hinge"),
    "shin_right": ("thigh_right", (0.0, -0.1, -0.65), (0.0, -0.1, -1.05), 0.05, 4.0, "hinge"),
}
"""Parent, ends from the middle of the torso [m], radius [m], mass [kg] and joint of a ragdoll's limbs."""
BENDS = {"forearm_left": (0.0, 0.0, -1.0), "forearm_right": (0.0, 0.0, 1.0)}
"""Axes about which elbows bend forward; knees bend backward about y."""


@scene
def ragdoll_stairs() -> Scenario:
    """A ragdoll of ten bodies falls down stairs; elbows and knees bend to one side, by 2.4 rad at most."""
    middle, speed = np.array((-0.1, 0.0, 1.2)), (1.0, 0.0, 0.0)
    torso = capsule("torso", "rubber", 0.13, 0.15, 30.0, vector(middle), velocity=speed)
    bodies, joints = [torso], []
    for name, (parent, first, last, radius, mass, kind) in LIMBS.items():
        ends = vector(middle + first), vector(middle + last)
        half = float(np.linalg.norm(np.subtract(*ends))) / 2
        place = vector(np.add(*ends) / 2)
        half_length = max(half - radius, 0.01)
        bodies.append(
            capsule(name, "rubber", radius, half_length, mass, place, direction(*ends), velocity=speed)
        )
        bound = {"lower": 0.0, "upper": 2.4} if kind == "hinge" else {}
        axis = BENDS.get(name, ACROSS)
        joints.append(
            BodyJoint(f"{parent}_{name}", kind, parent, name, ends[0], axis, damping=0.5, **bound)  # type: ignore[arg-type]
        )
    depth, height = STEP
    steps = tuple(
        Piece(f"step_{k}", Box((depth / 2, 1.0, 0.5)), (depth * (k - 0.5), 0.0, -0.5 - height * k))
        for k in range(6)
    )
    floor = Piece("floor", Box((2.0, 1.0, 0.5)), (5.5 * depth + 2.0 - depth / 2, 0.0, -0.5 - height * 6))
    stairs = Body("stairs", "fixed", "rubber", (*steps, floor))
    return mechanism(
        "ragdoll_stairs",
        "a ragdoll falls down stairs",
        [stairs, *bodies],
        joints,
        4.0,
        coefficients=even("rubber", mu=0.5),
        truths=(),
    )


LEAN, LADDER = radians(30.0), (0.03, 1.0)
"""First angle of a ladder from the wall [rad], its radius and its half length [m]."""
FREEMAN = (
    "Freeman & Palffy-Muhoray (1985), Am. J. Phys. 53, 276: without friction a ladder leaves the wall at two "
    "thirds of its first height; its tolerance is ours"
)


def ladder_leaves() -> tuple[float, float]:
    """Time at which a ladder leaves its wall [s], and its speed along the floor from then on [m/s].

    With k = I / (m h^2), h (1 + k) a'^2 = 2 g (cos a_0 - cos a) until cos a = 2/3 cos a_0.
    """
    radius, half = LADDER
    body = capsule("ladder", "steel", radius, half, 1.0)
    share = 1 + body.inertia[0][0] / half**2
    last = float(np.arccos(2 / 3 * cos(LEAN)))

    def slowness(root: float) -> float:
        angle = LEAN + root**2
        # cos a_0 - cos a, without cancellation
        fallen = 2 * sin((angle + LEAN) / 2) * sin((angle - LEAN) / 2)
        return 2 * root / sqrt(2 * GRAVITY * fallen / (half * share)) if root else 0.0

    time = quad(slowness, 0.0, sqrt(last - LEAN), epsabs=1e-12)[0]
    rate = sqrt(2 / 3 * GRAVITY * cos(LEAN) / (half * share))
    return time, half * cos(last) * rate


@scene
def ladder() -> Scenario:
    """A ladder without friction slides down a wall, which it leaves at two thirds of its first height."""
    radius, half = LADDER
    time, speed = ladder_leaves()
    middle = (half * sin(LEAN) + radius, 0.0, half * cos(LEAN) + radius)
    lean: Quaternion = quaternion(Rotation.from_rotvec((0.0, -LEAN, 0.0)))
    body = capsule("ladder", "steel", radius, half, 10.0, middle, lean)
    wall = block("wall", "steel", (0.5, 2.0, 2.0), 0.0, (-0.5, 0.0, 2.0), kind="fixed")
    end = round(60 * time + 6) / 60
    value = Published("speed", "ladder", "velocity", speed, 0.01 * speed, FREEMAN, end, end)
    return Scenario(
        name="ladder",
        summary="a ladder slides down a wall and leaves it",
        tags=("literature",),
        bodies=(slab("floor", "steel"), wall, body),
        coefficients=even("steel", mu=0.0),
        duration=end,
        published=(value,),
    )
