"""The libraries that judge a run: without them nothing that they measure gets a verdict.

`adapters.oracles` measures overlap and gaps (coal, python-fcl) and postures (pinocchio). All three are core
dependencies of the project; an installation that lacks one, or where an import fails, gets an error message.
"""

from __future__ import annotations

import importlib

JUDGES = {
    "touchstone.adapters.oracles.overlap": "overlap, gaps and passages",
    "touchstone.adapters.oracles.nearest_posture": "postures",
}
"""What each oracle measures."""


def judge_faults() -> list[str]:
    """One line per oracle that cannot be imported: what is not judged and why."""
    found = []
    for module, measured in JUDGES.items():
        try:
            importlib.import_module(module)
        except ImportError as error:
            found.append(f"{measured} cannot be judged: {fault_text(error)}")
    return found


def fault_text(error: ImportError) -> str:
    """Why a judge is not there, and how to get it, in one line."""
    reason = str(error).partition("\n")[0]
    return f"{reason} (pip install --force-reinstall touchstone)"
