"""Adapter of Drake through pydrake; it plays when it is named (extra `drake`, not part of `all`)."""

from touchstone.adapters.engines.entry import DEFAULT, EQUAL_STEP, RECOMMENDED, Entry

SAP, TAMSI, CENIC = "sap", "tamsi", "cenic"
ENTRY = Entry(
    "touchstone.adapters.engines.drake.engine:DrakeEngine",
    "pydrake",
    {RECOMMENDED: 1 / 1020, DEFAULT: 1 / 1020, SAP: 1 / 1020, TAMSI: 1 / 1020, CENIC: EQUAL_STEP},
    distribution="drake",
    color="#56B4E9",
    marker="triangle-down",
    requirement="drake",
    lacks=(
        *("restitution", "kinematic links", "prescribed bodies", "moving surfaces", "joints between bodies"),
        *("static friction", "rolling friction", "torsional friction"),
    ),
    settings="touchstone.adapters.engines.drake.settings:SETTINGS",
    script="touchstone.adapters.engines.drake.script",
)
