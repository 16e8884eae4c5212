"""Adapter of Drake through pydrake; it plays when it is named (extra `drake`, not part of `all`)."""

from touchstone.adapters.engines.entry import EQUAL_STEP, RECOMMENDED, Entry

SAP, TAMSI = "sap", "tamsi"
ENTRY = Entry(
    "touchstone.adapters.engines.drake.engine:DrakeEngine",
    "pydrake",
    {RECOMMENDED: 1 / 1020, "equal-step": EQUAL_STEP, SAP: 1 / 1020, TAMSI: 1 / 1020},
    distribution="drake",
    color="#56B4E9",
    marker="v",
    extra="touchstone[drake]",
)
