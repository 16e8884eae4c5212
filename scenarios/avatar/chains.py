"""Chains and their ball joints: hinge axes, limits, and validation."""

from collections.abc import Mapping
from math import pi

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.number_checks import Report, known
from touchstone.scenarios.scenario import ORIGIN, Chain, Joint, ReachCone, Scenario

TOLERANCE = 1e-9
"""Tolerance of unit lengths and right angles of directions [1]: rounding."""
STAR = 1e-6
"""Minimum volume spanned by the centre and two neighbouring corners of a star-shaped polygon [1]."""
SAMPLES = 41
"""Sample points on a cone's edge, and between its centre and edge, for the hinge limits."""
OPPOSITE = 1e-3
"""1 + cosine below which a cone's centre is opposite to the bone's rest [1]: the twist is undefined there."""


def hinge_axes(hinges: tuple[Joint, ...]) -> Array:
    """Axes of successive hinges at angles 0 as columns (3, n), in the frame of the first one's parent."""
    turned, axes = Rotation.identity(), []
    for hinge in hinges:
        axes.append(turned.apply(hinge.axis))
        turned = turned * Rotation.from_quat(np.array(hinge.orientation), scalar_first=True)
    return np.array(axes).T


def ball_limits(cone: ReachCone, axes: Array) -> Array:
    """Minimum and maximum angles (3, 2) [rad] of a ball joint's hinges over its reach cone, by sampling.

    Angles are on the branch of the centre, with the second angle between -pi/2 and pi/2.

    Args:
        axes: of the three hinges at angles 0, as columns.
    """
    center, corners = np.array(cone.center) @ axes, np.array(cone.swing) @ axes
    after = np.roll(corners, -1, axis=0)
    shares = np.linspace(0, 1, SAMPLES)
    edges = np.array([(1 - s) * corners + s * after for s in shares]).reshape(-1, 3)
    edges /= np.linalg.norm(edges, axis=1)[:, None]
    out = shortest_rotations(center, edges).as_rotvec()
    swings = Rotation.from_rotvec(np.array([s * out for s in shares]).reshape(-1, 3))
    swings = swings * shortest_rotations(np.array((0.0, 0.0, 1.0)), center[None])[0]
    twists = np.linspace(*cone.twist, 3)
    angles = np.array([(swings * Rotation.from_rotvec((0.0, 0.0, t))).as_euler("XYZ") for t in twists])
    # Choose the branch within half a turn of the centre's angles.
    middle = angles[1, 0]
    angles = middle + (angles - middle + pi) % (2 * pi) - pi
    return np.stack((angles.min(axis=(0, 1)), angles.max(axis=(0, 1))), axis=1)


def shortest_rotations(start: Array, ends: Array) -> Rotation:
    """Shortest rotations from a direction to others (n, 3)."""
    axes = np.cross(start, ends)
    size = np.linalg.norm(axes, axis=1)
    angles = np.arctan2(size, ends @ start)
    return Rotation.from_rotvec(axes * (angles / np.where(size > 0, size, 1))[:, None])


def check_chains(scenario: Scenario, report: Report) -> None:
    """Report the faults of a scenario's chains; its joints and trackers must be valid."""
    joints = {joint.name: joint for joint in scenario.joints}
    taken: dict[str, str] = {}
    for i, chain in enumerate(scenario.chains):
        path = f"chains[{i}]"
        if not chain.name or chain.name in [other.name for other in scenario.chains[:i]]:
            report(f"{path}.name", f"found {chain.name!r}, expected a name of its own")
        for k, name in enumerate(chain.joints):
            if known("joint", name, joints, f"{path}.joints[{k}]", report) and name in taken:
                report(f"{path}.joints[{k}]", f"{name!r} is in {taken[name]} already")
            taken.setdefault(name, path)
        if not chain.joints:
            report(f"{path}.joints", "found none, expected at least one")
        elif all(name in joints for name in chain.joints):
            _check_order(scenario, chain, joints, f"{path}.joints", report)
            for k, cone in enumerate(chain.cones):
                _check_cone(cone, chain, joints, f"{path}.cones[{k}]", report)


def _check_order(
    scenario: Scenario, chain: Chain, joints: Mapping[str, Joint], path: str, report: Report
) -> None:
    tracker = next(t for t in scenario.trackers if chain.joints[0] in t.joints)
    first = tracker.joints.index(chain.joints[0])
    for k, name in enumerate(chain.joints[1:], start=1):
        inner = joints[chain.joints[k - 1]]
        if joints[name].parent != inner.child:
            report(f"{path}[{k}]", f"{name!r} does not hang on {inner.child!r}, the child of {inner.name!r}")
        elif tracker.joints[first + k : first + k + 1] != (name,):
            report(f"{path}[{k}]", f"{name!r} does not follow {inner.name!r} in its tracker's order")


def _check_cone(
    cone: ReachCone, chain: Chain, joints: Mapping[str, Joint], path: str, report: Report
) -> None:
    names = tuple(cone.joints)
    runs = [chain.joints[k : k + 3] for k in range(len(chain.joints) - 2)]
    if names not in runs:
        report(f"{path}.joints", f"found {', '.join(names)}; expected three successive joints of the chain")
        return
    hinges = tuple(joints[name] for name in names)
    axes = hinge_axes(hinges)
    if any(hinge.position != ORIGIN for hinge in hinges[1:]):
        report(f"{path}.joints", "the second and third hinge must sit at the origin of their parents")
    if np.abs(axes.T @ axes - np.eye(3)).max() > TOLERANCE or np.linalg.det(axes) < 0:
        report(f"{path}.joints", "expected right-handed perpendicular axes at angles 0")
    low, high = cone.twist
    if not -pi <= low < high <= pi:
        report(f"{path}.twist", f"found {low} to {high}, expected -pi <= lower < upper <= pi")
    fields = {"center": np.array(cone.center, dtype=float), "swing": np.array(cone.swing, dtype=float)}
    for field, rows in fields.items():
        unit = rows.ndim in (1, 2) and rows.shape[-1] == 3 and np.isfinite(rows).all()
        if not unit or np.abs(np.linalg.norm(rows, axis=-1) - 1).max() > TOLERANCE:
            report(f"{path}.{field}", "expected unit vectors")
            return
    if 1 + fields["center"] @ axes[:, 2] < OPPOSITE:
        report(f"{path}.center", "is opposite to the bone's rest, where twist has no zero")
    if not _star_shaped(fields["center"], fields["swing"]):
        report(
            f"{path}.swing",
            "not star-shaped: seen from the centre, the corners must go round once, counterclockwise",
        )


def _star_shaped(center: Array, corners: Array) -> bool:
    following = np.roll(corners, -1, axis=0)
    # Each corner lies to the left of the previous one, by less than half a turn; together they make one turn.
    left = np.cross(corners, following) @ center
    flat = corners - np.outer(corners @ center, center)
    after = np.roll(flat, -1, axis=0)
    turns = np.arctan2(np.cross(flat, after) @ center, (flat * after).sum(axis=1))
    return len(corners) >= 3 and bool(left.min() > STAR) and abs(turns.sum() - 2 * pi) < 1
