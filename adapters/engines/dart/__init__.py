"""Adapter of DART 6 through dartpy."""

from touchstone.adapters.engines.entry import ACCURATE, DEFAULT, EQUAL_STEP, RECOMMENDED, SLEEPING, Entry

ENTRY = Entry(
    "touchstone.adapters.engines.dart.engine:DartEngine",
    "dartpy",
    {
        RECOMMENDED: 1 / 1020,
        "equal-step": EQUAL_STEP,
        DEFAULT: 1 / 1020,
        ACCURATE: 1 / 1020,
        SLEEPING: 1 / 1020,
    },
    color="#AA4499",
    marker="triangle-up",
    rounding="vertices of hulls in single precision",
    requirement="dartpy<7",
    lacks=("static friction", "rolling friction", "torsional friction"),
    settings="touchstone.adapters.engines.dart.settings:SETTINGS",
    script="touchstone.adapters.engines.dart.script",
)
