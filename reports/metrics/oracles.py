"""The libraries that judge a run; without them their metrics get no verdict.

`adapters.oracles` measures overlap and gaps (coal) and postures (pinocchio). Both are core
dependencies of the project. If one is missing or its import fails, the user gets an error message.
"""

from __future__ import annotations

import importlib

JUDGES = {
    "touchstone.adapters.oracles.overlap": "overlap, gaps and passages",
    "touchstone.adapters.oracles.nearest_posture": "postures",
}
"""Quantity that each oracle measures."""
REINSTALLED = "coal pin numba"
"""What pip reinstalls: the oracles' packages, and numba so that numpy stays at a version that it takes."""


def judge_faults() -> list[str]:
    """One line per oracle that cannot be imported: the unjudged quantities and the reason."""
    found = []
    for module, measured in JUDGES.items():
        try:
            importlib.import_module(module)
        except ImportError as error:
            found.append(f"{measured} cannot be judged: {fault_text(error)}")
    return found


def fault_text(error: ImportError) -> str:
    """The reason why an oracle is missing and how to install it, in one line."""
    reason = str(error).partition("\n")[0]
    return f"{reason} (pip install --force-reinstall {REINSTALLED})"
