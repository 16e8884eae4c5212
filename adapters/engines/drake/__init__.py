"""Adapter of Drake through pydrake; it plays when it is named (extra `drake`, not part of `all`)."""

from touchstone.adapters.engines.entry import Entry

POINT, SAP, TAMSI = "point", "sap", "tamsi"
ENTRY = Entry(
    "touchstone.adapters.engines.drake.engine:DrakeEngine",
    "pydrake",
    {POINT: 1 / 1020, SAP: 1 / 1020, TAMSI: 1 / 1020},
    distribution="drake",
    color="#56B4E9",
    marker="v",
    requirement="drake",
    settings="touchstone.adapters.engines.drake.settings:SETTINGS",
)
