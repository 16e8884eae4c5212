"""Adapter of the reference implementation."""

from touchstone.adapters.engines.entry import EQUAL_STEP, Entry

ENTRY = Entry(
    "touchstone.adapters.engines.reference.engine:ReferenceEngine",
    "numba",
    {"balanced": 1 / 60, "paper": 1 / 60, "accurate": 1 / 60, "equal-step": EQUAL_STEP},
    distribution="touchstone-contact",
    color="#000000",
    marker="circle",
    requirement="numba",
    compiles="touchstone.adapters.engines.reference.compile_progress:compile_progress",
    settings="touchstone.adapters.engines.reference.settings:SETTINGS",
)
