"""Validation of a scenario: all its faults, each with the path of the field."""

from collections import Counter
from collections.abc import Callable, Sequence
from itertools import combinations_with_replacement, pairwise
from math import inf, nan, ulp
from typing import get_args

import numpy as np
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from touchstone.scenarios.avatar.chains import check_chains
from touchstone.scenarios.avatar.number_checks import (
    LARGEST,
    LONGEST,
    SHORTEST,
    UNIT_TOLERANCE,
    Report,
    finite,
    finite_rows,
    known,
    positive,
    sizes,
    unit,
)
from touchstone.scenarios.avatar.tracker_checks import check_driving, check_tracker
from touchstone.scenarios.body_joints import check_body_joints
from touchstone.scenarios.effects import centred_ball
from touchstone.scenarios.plural import plural
from touchstone.scenarios.scenario import (
    CHECKS,
    EFFECTS,
    EVENTS,
    IDENTITY,
    ORIGIN,
    TRACKED,
    UNMOVED,
    Body,
    BodyJoint,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Joint,
    Kind,
    Law,
    Piece,
    RoundedBox,
    RoundedHull,
    Scenario,
    Shape,
    Sphere,
    Truth,
)
from touchstone.scenarios.solids import box_corners
from touchstone.scenarios.truths.force_checks import check_forces
from touchstone.scenarios.truths.mechanism import check_mechanism
from touchstone.scenarios.truths.pair_names import ambiguities
from touchstone.scenarios.truths.published import check_published
from touchstone.scenarios.truths.rolling_cone import check_rolling_cone
from touchstone.scenarios.truths.smooth_contact import check_smooth_contact
from touchstone.scenarios.truths.stick_slip import check_stick_slip
from touchstone.scenarios.truths.tipping import check_tipping

LONGEST_NAME = 100
"""Characters of a body's, joint's or piece's name: they stand in tables and pictures."""
SHAPES = tuple(kind.__name__ for kind in get_args(Shape))

COEFFICIENTS = (
    ("friction", LARGEST, ""),
    ("static_friction", LARGEST, ""),
    ("rolling_friction", LONGEST, " m"),
    ("torsional_friction", LONGEST, " m"),
)
"""Coefficients of friction, the largest of each, and its unit."""

FLATNESS = 1e-6
"""Volume of a hull, relative to the cube of its size, below which it counts as flat [1]."""
SYMMETRY = 1e-12
"""Relative tolerance of the inertia's symmetry and triangle inequality [1]: rounding."""
DISTINCT = 1e-9
"""Minimum difference of a free top's moments, and minimum rates, relative to the largest [1]: rounding."""
WHOLE = 1e-9
"""Tolerance of duration times frame rate as a whole number [frames]."""
MOST_FRAMES = 10**9
"""Number of frames that no memory holds [1]."""


@np.errstate(all="ignore")  # numbers that overflow are faults themselves, and warn nobody
def faults(scenario: Scenario) -> list[tuple[str, str]]:
    """All faults of a scenario as (path of the field, what was found and what is expected)."""
    found: list[tuple[str, str]] = []

    def report(path: str, message: str) -> None:
        found.append((path, message))

    _check_numbers(scenario, report)
    _check_names(scenario, report)
    joined = {name for joint in scenario.body_joints for name in (joint.parent, joint.child)}
    for i, body in enumerate(scenario.bodies):
        _check_body(body, f"bodies[{i}]", body.name in joined, report)
    _check_joints(scenario, report)
    check_body_joints(scenario, report)
    _check_exclusions(scenario, report)
    for i, tracker in enumerate(scenario.trackers):
        check_tracker(scenario, tracker, f"trackers[{i}]", report)
    check_driving(scenario, report)
    if not found:  # the checks of chains require valid joints and trackers
        check_chains(scenario, report)
    _check_coefficients(scenario, report)
    _check_expectations(scenario, report)
    _check_truths(scenario, report)
    check_forces(scenario, report, sound=not found)
    check_published(scenario.published, [body.name for body in scenario.bodies], scenario.duration, report)
    return found


CHECKS.append(faults)


def _check_numbers(scenario: Scenario, report: Report) -> None:
    finite(scenario.gravity, "gravity", report, 3, LONGEST)
    for field, least in (("frame_rate", 1), ("seed", 0)):
        value = getattr(scenario, field)
        if not isinstance(value, int) or value < least:
            report(field, f"found {value!r}, expected a whole number from {least} on")
    positive([scenario.duration], "duration", report)
    frames = scenario.duration * min(scenario.frame_rate, MOST_FRAMES)
    if frames > 0 and not (0.5 < frames < MOST_FRAMES and abs(frames - round(frames)) <= WHOLE):
        report("duration", f"found {frames:g} frames, expected a whole number from 1 to {MOST_FRAMES - 1}")
    for i, effect in enumerate(scenario.effects):
        if known("effect", effect, EFFECTS, f"effects[{i}]", report) and effect in scenario.effects[:i]:
            report(f"effects[{i}]", f"{effect!r} is named twice")


def _check_exclusions(scenario: Scenario, report: Report) -> None:
    """Report groups of bodies without contact that are no groups, or whose bodies follow trackers."""
    valid = [body.name for body in scenario.bodies if body.kind not in TRACKED]
    for i, names in enumerate(scenario.contact_exclusions):
        if len(set(names)) < 2 or len(set(names)) < len(names):
            report(f"contact_exclusions[{i}]", f"found {list(names)}, expected two different bodies or more")
        for k, name in enumerate(names):
            if name not in valid:
                report(
                    f"contact_exclusions[{i}][{k}]",
                    f"found {name!r}, expected a simulated or fixed body: {', '.join(valid)}",
                )


def _check_names(scenario: Scenario, report: Report) -> None:
    groups: dict[str, tuple[Body | BodyJoint | Joint | Piece, ...]] = {
        "bodies": scenario.bodies,
        "joints": scenario.joints,
        "body_joints": scenario.body_joints,
    }
    groups |= {f"bodies[{i}].pieces": body.pieces for i, body in enumerate(scenario.bodies)}
    for path, group in groups.items():
        seen: set[str] = set()
        for i, name in enumerate(item.name for item in group):
            if not name:
                report(f"{path}[{i}].name", "found none, expected a name")
            elif not name.isprintable() or len(name) > LONGEST_NAME:
                expected = f"at most {LONGEST_NAME} printable characters"
                report(f"{path}[{i}].name", f"found {name[:LONGEST_NAME]!r}, expected {expected}")
            elif name in seen:
                report(f"{path}[{i}].name", f"{name!r} is used twice")
            seen.add(name)
    for i, reason in ambiguities([body.name for body in scenario.bodies]):
        report(f"bodies[{i}].name", reason)
    if not scenario.name:
        report("name", "found none, expected a name")
    if not scenario.bodies:
        report("bodies", "found none, expected at least one")


def _check_body(body: Body, path: str, is_joined: bool, report: Report) -> None:
    if body.kind not in get_args(Kind):
        report(f"{path}.kind", f"unknown kind {body.kind!r}; valid: {', '.join(get_args(Kind))}")
    unit(body.orientation, f"{path}.orientation", report, 4)
    for field in ("position", "linear_velocity", "angular_velocity", "center_of_mass"):
        finite(getattr(body, field), f"{path}.{field}", report, 3, LONGEST)
    if body.kind not in UNMOVED:
        weighed = positive([body.mass], f"{path}.mass", report, most=inf, least=ulp(0.0))
        if finite_rows(body.inertia, f"{path}.inertia", report, 3, inf):
            mass = body.mass if weighed else nan
            _check_inertia(np.array(body.inertia), mass, f"{path}.inertia", report)
    still = ("linear_velocity", "angular_velocity")
    tracked = dict.fromkeys(TRACKED, ("position", "orientation", *still))
    for field in ({"fixed": still} | tracked).get(body.kind, ()):
        if tuple(getattr(body, field)) != (IDENTITY if field == "orientation" else ORIGIN):
            given = "by its tracker" if body.kind in TRACKED else "by standing still"
            report(f"{path}.{field}", f"found {getattr(body, field)}, but a {body.kind} body has it {given}")
    if not body.pieces and body.kind != "driven" and not (body.kind == "simulated" and is_joined):
        report(f"{path}.pieces", "found none, expected at least one")
    for k, piece in enumerate(body.pieces):
        check_piece(piece, f"{path}.pieces[{k}]", report)
        if isinstance(piece.shape, HalfSpace) and body.kind != "fixed":
            found = f"found a half-space on a {body.kind} body, expected a fixed one"
            report(f"{path}.pieces[{k}].shape", found)
        for field in ("surface_velocity", "surface_angular_velocity"):
            finite(getattr(piece, field), f"{path}.pieces[{k}].{field}", report, 3, LONGEST)
            if body.kind not in UNMOVED and any(getattr(piece, field)):
                report(
                    f"{path}.pieces[{k}].{field}",
                    f"{body.name!r} is {body.kind}, expected {' or '.join(UNMOVED)}",
                )


def check_piece(piece: Piece, path: str, report: Report) -> None:
    """Report what is wrong with a piece's pose and shape."""
    finite(piece.position, f"{path}.position", report, 3, LONGEST)
    unit(piece.orientation, f"{path}.orientation", report, 4)
    _check_shape(piece.shape, f"{path}.shape", report)


def _check_inertia(inertia: np.ndarray, mass: float, path: str, report: Report) -> None:
    if inertia.shape != (3, 3):
        report(path, f"found {plural(len(inertia), 'row')}, expected 3")
        return
    if np.abs(inertia - inertia.T).max() > SYMMETRY * np.abs(inertia).max():
        report(path, "found an asymmetric matrix, expected a symmetric one")
        return
    moments = np.linalg.eigvalsh(inertia)
    if moments[0] <= 0:
        report(path, f"found the principal moment {moments[0]:.6g} kg m^2, expected positive ones")
    elif moments[2] > (moments[0] + moments[1]) * (1 + SYMMETRY):
        found = ", ".join(f"{moment:.6g}" for moment in moments)
        reason = "break the triangle inequality: the largest must not exceed the sum of the others"
        report(path, f"principal moments {found} kg m^2 {reason}")
    elif moments[0] < mass * SHORTEST**2 or moments[2] > mass * LONGEST**2:
        expected = f"radii of gyration from {SHORTEST:g} to {LONGEST:g} m"
        report(path, f"found {moments[0]:g} kg m^2 beside {mass:g} kg, expected {expected}")


def _check_shape(shape: Shape, path: str, report: Report) -> None:
    match shape:
        case Sphere(radius):
            sizes([radius], f"{path}.radius", report)
        case Box(half_extents):
            sizes(half_extents, f"{path}.half_extents", report, 3)
        case Capsule(radius, half_length) | Cylinder(radius, half_length) | Cone(radius, half_length):
            sizes([radius], f"{path}.radius", report)
            sizes([half_length], f"{path}.half_length", report)
        case Ellipsoid(half_axes):
            sizes(half_axes, f"{path}.half_axes", report, 3)
        case Hull(vertices):
            if finite_rows(vertices, f"{path}.vertices", report, 3, LONGEST):
                _check_hull(np.array(vertices, dtype=float).reshape(-1, 3), f"{path}.vertices", report)
        case RoundedBox(half_extents, radius):
            _check_shape(Sphere(radius), path, report)
            if sizes(half_extents, f"{path}.half_extents", report, 3):
                _check_hull(np.array(box_corners(half_extents)), f"{path}.half_extents", report)
        case RoundedHull(vertices, radius):
            _check_shape(Hull(vertices), path, report)
            _check_shape(Sphere(radius), path, report)
        case HalfSpace():
            pass
        case _:
            report(path, f"unknown shape {type(shape).__name__}; valid: {', '.join(SHAPES)}")


def _check_hull(vertices: np.ndarray, path: str, report: Report) -> None:
    if len(vertices) < 4:
        report(path, f"found {plural(len(vertices), 'vertex')}, expected at least 4")
        return
    size = np.ptp(vertices, axis=0).max()
    sizes([size], path, report)
    try:
        hull = ConvexHull(vertices)
    except QhullError:
        report(path, "degenerate: the vertices lie in a plane, on a line or in a point")
        return
    if hull.volume < FLATNESS * size**3:
        report(path, f"degenerate: volume {hull.volume:.3g} m^3 at a size of {size:.3g} m")
    inside = sorted(set(range(len(vertices))) - set(hull.vertices.tolist()))
    if inside:
        report(path, f"not convex: vertices {inside[:5]} are repeated or no corners of their convex hull")


def _check_joints(scenario: Scenario, report: Report) -> None:
    names = {body.name: body for body in scenario.bodies}
    for i, joint in enumerate(scenario.joints):
        path = f"joints[{i}]"
        for field in ("parent", "child"):
            name = getattr(joint, field)
            if known("body", name, names, f"{path}.{field}", report) and names[name].kind != "driven":
                report(f"{path}.{field}", f"{name!r} is {names[name].kind}, expected a driven body")
        if joint.parent == joint.child:
            report(f"{path}.child", f"{joint.child!r} is its own parent")
        finite(joint.position, f"{path}.position", report, 3, LONGEST)
        unit(joint.axis, f"{path}.axis", report, 3)
        unit(joint.orientation, f"{path}.orientation", report, 4)
        limits_are_numbers = finite((joint.lower, joint.upper), f"{path}.lower", report)
        if limits_are_numbers and not joint.lower < joint.upper:
            report(f"{path}.lower", f"found {joint.lower}, expected less than upper = {joint.upper}")


def _check_coefficients(scenario: Scenario, report: Report) -> None:
    seen: set[frozenset[str]] = set()
    for i, pair in enumerate(scenario.coefficients):
        pair_names = frozenset((pair.material_a, pair.material_b))
        if pair_names in seen:
            report(f"coefficients[{i}]", f"{' and '.join(sorted(pair_names))}: the pair is named twice")
        seen.add(pair_names)
        if not 0 <= pair.restitution <= 1:
            report(f"coefficients[{i}].restitution", f"found {pair.restitution}, expected 0 to 1")
        for name, most, ends in COEFFICIENTS:
            if not 0 <= getattr(pair, name) <= most:
                expected = f"expected 0 to {most:g}{ends}"
                report(f"coefficients[{i}].{name}", f"found {getattr(pair, name)}, {expected}")
        if 0 < pair.static_friction < pair.friction:
            report(
                f"coefficients[{i}].static_friction",
                f"found {pair.static_friction}, expected at least friction = {pair.friction}, or 0",
            )
    materials = sorted({name for names in seen for name in names})
    missing = set()
    for i, body in enumerate(scenario.bodies):
        if body.material not in materials:
            valid = ", ".join(materials) or "none"
            report(f"bodies[{i}].material", f"unknown {body.material!r}; valid: {valid}")
    groups = Counter((body.material, body.kind in UNMOVED) for body in scenario.bodies)
    for (a, a_stays), (b, b_stays) in combinations_with_replacement(groups, 2):
        alone = (a, a_stays) == (b, b_stays) and groups[a, a_stays] == 1
        if not (alone or (a_stays and b_stays) or {a, b} in seen) and {a, b} <= set(materials):
            missing.add(tuple(sorted((a, b))))
    for names in sorted(missing):
        report("coefficients", f"no coefficients for the pair {' and '.join(names)}")


def _check_expectations(scenario: Scenario, report: Report) -> None:
    names = [body.name for body in scenario.bodies]
    for i, expectation in enumerate(scenario.expectations):
        path = f"expectations[{i}]"
        known("event", expectation.event, EVENTS, f"{path}.event", report)
        for field in ("body", "other"):
            known("body", getattr(expectation, field), names, f"{path}.{field}", report)
        if expectation.body == expectation.other:
            report(f"{path}.other", f"{expectation.other!r} is the body itself")
        if not 0 <= expectation.earliest < expectation.latest <= scenario.duration:
            report(f"{path}.earliest", f"expected 0 <= earliest < latest <= {scenario.duration}")


def _check_truths(scenario: Scenario, report: Report) -> None:
    bodies = {body.name: body for body in scenario.bodies}
    trackers = {tracker.root: tracker for tracker in scenario.trackers}
    for i, truth in enumerate(scenario.truths):
        path = f"truths[{i}]"
        body = bodies.get(truth.body)
        if truth.law not in get_args(Law):
            report(f"{path}.law", f"unknown law {truth.law!r}; valid: {', '.join(get_args(Law))}")
        elif body is None:
            report(f"{path}.body", f"unknown body {truth.body!r}; valid: {', '.join(bodies)}")
        elif truth.law == "coupling" and truth.body not in trackers:
            report(f"{path}.body", f"{truth.body!r} follows no tracker, as the law coupling asks")
        elif truth.law == "coupling":
            tracker = trackers[truth.body]
            if tracker.joints or len(set(tracker.orientations)) > 1 or tuple(body.center_of_mass) != ORIGIN:
                report(
                    f"{path}.body", "expected one link about its centre of mass whose tracker does not turn"
                )
        elif body.kind != "simulated":
            report(f"{path}.body", f"{truth.body!r} is {body.kind}, expected a simulated body")
        elif truth.law in ("carried", "turntable"):
            _check_support(scenario, truth, body, f"{path}.body", report)
        elif truth.law in CHECKS_OF_LAWS:
            CHECKS_OF_LAWS[truth.law](scenario, body, f"{path}.body", report)
        if truth.body in [other.body for other in scenario.truths[:i]]:
            report(f"{path}.body", f"{truth.body!r} has two truths")
        _check_arcs(truth, path, report)


def _check_support(scenario: Scenario, truth: Truth, body: Body, path: str, report: Report) -> None:
    """Check for gravity, one prescribed body, and the motion of both that the closed form requires."""
    trackers = list(filter(scenario.prescribes, scenario.trackers))
    if len(trackers) != 1 or not any(scenario.acting_gravity):
        report(path, f"found {len(trackers)} prescribed bodies, expected one, and gravity")
    elif trackers[0].interpolation == "linear":
        report(path, f"{trackers[0].root!r} is linear between keyframes, expected a velocity without jumps")
    elif truth.law == "carried" and (
        len(set(trackers[0].orientations)) > 1 or any((*body.linear_velocity, *body.angular_velocity))
    ):
        report(path, "expected a body at rest on a prescribed one that does not turn")
    elif truth.law == "turntable" and (
        len(set(trackers[0].positions)) > 1
        or len(body.pieces) != 1
        or not isinstance(body.pieces[0].shape, Sphere)
        or not centred_ball(body)
    ):
        report(path, "expected a ball about its centre of mass on a prescribed body that only turns")


def _check_top(_: Scenario, body: Body, path: str, report: Report) -> None:
    """Check for three different moments and a spin off the principal axes, as the closed form requires."""
    inertia = np.array(body.inertia)
    if inertia.shape != (3, 3):
        return
    moments, axes = np.linalg.eigh(inertia)
    turned = Rotation.from_quat(body.orientation, scalar_first=True).as_matrix() @ axes
    rates = np.abs(turned.T @ np.array(body.angular_velocity))
    if np.min(np.diff(moments)) <= DISTINCT * moments[2]:
        report(path, f"principal moments {', '.join(f'{m:.6g}' for m in moments)}: expected three different")
    elif np.sum(rates > DISTINCT * rates.max()) < 2:
        report(path, "spins about a principal axis, expected a spin off all three")


CHECKS_OF_LAWS: dict[str, Callable[[Scenario, Body, str, Report], None]] = {
    "torque_free": _check_top,
    "smooth_contact": check_smooth_contact,
    "rolling_cone": check_rolling_cone,
    "tipping": check_tipping,
    "mechanism": check_mechanism,
    "stick_slip": check_stick_slip,
}


def _direction(vector: Sequence[float]) -> np.ndarray:
    """A vector over its largest component, so that no product overflows; 0 if that is 0 or not finite."""
    values = np.array(vector, dtype=float)
    largest = np.abs(values).max(initial=0.0)
    return values / largest if 0 < largest < np.inf else 0 * np.nan_to_num(values)


def _check_arcs(truth: Truth, path: str, report: Report) -> None:
    if bool(truth.arcs) != (truth.law == "arcs"):
        report(f"{path}.arcs", f"found {len(truth.arcs)}, which does not fit the law {truth.law!r}")
        return
    starts = [arc.start for arc in truth.arcs]
    if truth.arcs and (starts[0] != 0 or any(a >= b for a, b in pairwise(starts))):
        report(f"{path}.arcs", "expected increasing starts from 0 on")
    fields = ("position", "velocity", "acceleration", "angular_velocity", "angular_acceleration")
    for k, arc in enumerate(truth.arcs):
        for field in fields:
            finite(getattr(arc, field), f"{path}.arcs[{k}].{field}", report, 3)
        spin, change = map(_direction, (arc.angular_velocity, arc.angular_acceleration))
        if spin.shape == change.shape == (3,) and np.linalg.norm(np.cross(spin, change)) > (
            UNIT_TOLERANCE * np.linalg.norm(spin) * np.linalg.norm(change)
        ):
            report(f"{path}.arcs[{k}].angular_acceleration", "expected along the angular velocity")
