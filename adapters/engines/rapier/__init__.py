"""Adapter of Rapier, which plays when it is named, in an environment of its own."""

from touchstone.adapters.engines.entry import ACCURATE, DEFAULT, RECOMMENDED, Entry

ENTRY = Entry(
    "touchstone.adapters.engines.rapier.engine:RapierEngine",
    "rapier3d",
    {RECOMMENDED: 1 / 60, DEFAULT: 1 / 60, ACCURATE: 1 / 60},
    color="#44AA99",
    marker="arrow",
    rounding="everything in single precision",
    requirement="rapier3d",
    settings="touchstone.adapters.engines.rapier.settings:SETTINGS",
    lacks=(
        *("ellipsoids", "moving surfaces", "joints between bodies"),
        *("static friction", "rolling friction", "torsional friction"),
    ),
    pins=("rapier3d==0.36.1",),
)
