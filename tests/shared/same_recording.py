"""Recordings that are equal to the bit, and the scenes that two tests share out between them for that."""

from dataclasses import fields

import numpy as np

from touchstone.adapters.recording import Recording
from touchstone.scenarios.catalogue import catalogue

SHORT = [name for name, one in catalogue().items() if "heap" not in one.tags and one.duration < 5]
"""Scenes that are soon played."""
OF_THE_CLOCK = ("manifest", "time_frame", "time_drive", "time_read", "time_crossing", "stage_seconds")
"""Fields of a recording that no two runs share."""


def different(one: Recording, two: Recording) -> set[str]:
    """Names of the fields in which two recordings differ, but for what the clock says."""
    return {
        field.name
        for field in fields(Recording)
        if field.name not in OF_THE_CLOCK
        and np.asarray(getattr(one, field.name)).tobytes() != np.asarray(getattr(two, field.name)).tobytes()
    }
