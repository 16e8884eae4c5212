"""Frames of work: those in which an engine reports a contact."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.recording import Recording
from touchstone.reports.metrics.context import ROUNDING

CONTACTING = "pairs.contacting"
"""Counter of the reference: pairs that touch in the driven loop, which resolves them without impulses."""


def contact_frames(recording: Recording) -> NDArray[np.bool_]:
    """Frames (f,) in which a contact bears an impulse, or a driven body is kept off an obstacle."""
    found = np.zeros(len(recording.time_frame), dtype=bool)
    rows: Any = recording.contacts[np.abs(recording.contacts["impulse"]).max(axis=1, initial=0.0) > 0]
    rate = 1 / recording.time[1] if len(recording.time) > 1 else 1.0
    frames = np.floor(rows["time"] * rate + ROUNDING).astype(int)
    found[frames[frames < len(found)]] = True
    names = recording.work_names.tolist()
    if CONTACTING in names:
        found |= recording.work[:, names.index(CONTACTING)] > 0
    return found
