"""Hash of a run's states: a change of one bit in any frame shows."""

from __future__ import annotations

import hashlib

import numpy as np

from touchstone.adapters.recording import Recording
from touchstone.reports.metrics.context import Context, Value, Values

STATES = ("position", "orientation", "linear_velocity", "angular_velocity", "joint_angle", "joint_rate")
"""Fields of a recording that are hashed, in this order."""
DIGITS = 13
"""Hexadecimal digits that a float holds exactly."""


def state_hash(recording: Recording) -> str:
    """Hash of all states of all frames (16 hexadecimal digits): equal exactly where all bits are.

    It depends neither on times nor on what an engine counted. -0.0 and 0.0 differ.
    """
    found = hashlib.sha256()
    for name in STATES:
        found.update(np.ascontiguousarray(getattr(recording, name), dtype="<f8").tobytes())
    return found.hexdigest()[:16]


def state_hashed(context: Context) -> Values:
    """Hash of all states of all frames, as a number; its digits are the remark [1]."""
    digits = state_hash(context.recording)
    return {"": Value(float(int(digits[:DIGITS], 16)), digits)}
