"""Validation of the truths of contact forces."""

from touchstone.scenarios.avatar.number_checks import Report, finite, known, positive
from touchstone.scenarios.scenario import Scenario
from touchstone.scenarios.truths.force_truth import QUANTITIES
from touchstone.scenarios.truths.named_pairs import named_pairs


def check_forces(scenario: Scenario, report: Report, sound: bool) -> None:
    """Report faults of `forces`: pairs that cannot touch, empty windows, values that are not positive.

    Args:
        sound: whether the bodies, joints and trackers are valid, as the check of pairs requires.
    """
    names = [body.name for body in scenario.bodies]
    for i, truth in enumerate(scenario.forces):
        path = f"forces[{i}]"
        known("quantity", truth.quantity, QUANTITIES, f"{path}.quantity", report)
        positive([truth.value], f"{path}.value", report)
        body = known("body", truth.body, names, f"{path}.body", report)
        other = known("body", truth.other, names, f"{path}.other", report)
        if sound and body and other and not named_pairs(scenario, truth.body, truth.other):
            report(f"{path}.other", f"{truth.body!r} and {truth.other!r} cannot touch")
        if not finite((truth.start, truth.end), f"{path}.start", report):
            continue
        if not 0 <= truth.start < truth.end <= scenario.duration:
            report(f"{path}.start", f"expected 0 <= start < end <= {scenario.duration}")
        elif scenario.frame_rate >= 1 and len(range(*truth.frames(scenario.frame_rate))) == 0:
            report(f"{path}.end", f"no frame of 1/{scenario.frame_rate} s lies between start and end")
