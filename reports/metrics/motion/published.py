"""Errors against the values that others published of a scene."""

from __future__ import annotations

from touchstone.reports.metrics.context import Context, NotMeasured, Value, Values
from touchstone.scenarios.truths.body_motion import Motion


def published_error(context: Context) -> Values:
    """Difference of a measured from a published value, over the published tolerance [1]."""
    scenario, recording = context.scenario, context.recording
    if not scenario.published:
        raise NotMeasured("the scene states no published value")
    if recording.time[-1] < max(one.end for one in scenario.published) - context.frame / 2:
        raise NotMeasured("the end was not played")

    def motion(name: str) -> Motion:
        k = scenario.body_index(name)
        return Motion(
            context.mass_centers[:, k],
            recording.linear_velocity[:, k],
            recording.orientation[:, k],
            recording.angular_velocity[:, k],
        )

    found = {}
    for one in scenario.published:
        value = one.measured(recording.time, motion(one.body), motion(one.other) if one.other else None)
        text = f"{value:.6g} of {one.value:.6g} {one.unit}"
        found[one.name] = Value((value - one.value) / one.tolerance, text)
    return found
