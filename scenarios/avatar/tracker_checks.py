"""Validation of trackers: their keyframes, and what each of them drives."""

from dataclasses import MISSING, fields
from itertools import pairwise

from touchstone.scenarios.avatar.number_checks import LONGEST, Report, finite, positive, unit
from touchstone.scenarios.plural import plural
from touchstone.scenarios.scenario import INTERPOLATIONS, TRACKED, Scenario, Tracker

WHOLE = 1e-9
"""Tolerance of the scene's end as a keyframe's time [s]: rounding."""
COUPLING = ("joints", "stiffness", "damping", "hinge_frequency")
"""Fields of a tracker that a prescribed body does not use."""


def check_driving(scenario: Scenario, report: Report) -> None:
    """Check that every driven body and every joint belongs to exactly one tracker, once."""
    joints = {joint.name: joint for joint in scenario.joints}
    posed: dict[str, list[str]] = {}
    driven: dict[str, list[str]] = {}
    for i, tracker in enumerate(scenario.trackers):
        driven.setdefault(tracker.root, []).append(f"trackers[{i}].root")
        for k, name in enumerate(tracker.joints):
            posed.setdefault(name, []).append(f"trackers[{i}].joints[{k}]")
            if name in joints:
                driven.setdefault(joints[name].child, []).append(f"trackers[{i}].joints[{k}]")
    for i, body in enumerate(scenario.bodies):
        ways = driven.get(body.name, [])
        if body.kind in TRACKED and len(ways) != 1:
            found = f"by {' and '.join(ways)}" if ways else "by no tracker"
            report(f"bodies[{i}]", f"{body.name!r} is {body.kind} {found}, expected one")
    for i, joint in enumerate(scenario.joints):
        if joint.name not in posed:
            report(f"joints[{i}]", f"{joint.name!r} is posed by no tracker")


def check_tracker(scenario: Scenario, tracker: Tracker, path: str, report: Report) -> None:
    joints = {joint.name: joint for joint in scenario.joints}
    reached = {tracker.root}
    if tracker.root not in {b.name for b in scenario.bodies if b.kind in TRACKED}:
        report(f"{path}.root", f"{tracker.root!r} is not a driven or prescribed body")
    for k, name in enumerate(tracker.joints):
        if name not in joints:
            report(f"{path}.joints[{k}]", f"unknown joint {name!r}; valid: {', '.join(joints)}")
        elif joints[name].parent not in reached:
            report(f"{path}.joints[{k}]", f"{name!r} comes before the joint that leads to its parent")
        else:
            reached.add(joints[name].child)
    count = len(tracker.times)
    if not finite(tracker.times, f"{path}.times", report):
        return
    twice = [k for k, (a, b) in enumerate(pairwise(tracker.times), start=1) if a == b]
    for k in twice:
        report(f"{path}.times[{k}]", f"{tracker.root!r} has two poses at {tracker.times[k]:g} s")
    if count < 2 or any(a > b for a, b in pairwise(tracker.times)):
        report(f"{path}.times", "expected at least two increasing times")
    elif tracker.times[0] > 0 or tracker.times[-1] < scenario.duration - WHOLE:
        report(f"{path}.times", f"must cover 0 to {scenario.duration} s")
    for field, width in (("positions", 3), ("orientations", 4), ("angles", len(tracker.joints))):
        rows = getattr(tracker, field)
        if len(rows) != count or any(len(row) != width for row in rows):
            report(f"{path}.{field}", f"expected {plural(count, 'row')} of {width}")
            continue
        for k, row in enumerate(rows):
            if field == "orientations":
                unit(row, f"{path}.{field}[{k}]", report, 4)
            else:
                finite(row, f"{path}.{field}[{k}]", report, most=LONGEST)
    if scenario.prescribes(tracker):
        _check_path(tracker, path, report)
    if tracker.interpolation not in INTERPOLATIONS:
        valid = ", ".join(INTERPOLATIONS)
        report(f"{path}.interpolation", f"unknown {tracker.interpolation!r}; valid: {valid}")
    positive([tracker.stiffness], f"{path}.stiffness", report)
    positive([tracker.damping], f"{path}.damping", report)
    positive([tracker.hinge_frequency], f"{path}.hinge_frequency", report)


def _check_path(tracker: Tracker, path: str, report: Report) -> None:
    """Check that the tracker of a prescribed body has nothing but keyframes."""
    unused = {field.name: field.default for field in fields(tracker) if field.name in COUPLING}
    for name, default in unused.items():
        found, expected = getattr(tracker, name), () if default is MISSING else default
        if found != expected:
            reason = f"{tracker.root!r} is prescribed: it follows its keyframes, without joints"
            report(f"{path}.{name}", f"found {found!r}, but {reason} or a coupling")
    if tracker.interpolation == "held":
        report(f"{path}.interpolation", f"found 'held', but {tracker.root!r} is prescribed: it does not jump")
