"""Adapter of PhysX through SAPIEN, which plays when it is named, in an environment of its own."""

from touchstone.adapters.engines.entry import DEFAULT, RECOMMENDED, Entry

PGS = "pgs"
ENTRY = Entry(
    "touchstone.adapters.engines.physx.engine:PhysxEngine",
    "sapien",
    {RECOMMENDED: 1 / 120, DEFAULT: 1 / 120, PGS: 1 / 120},
    color="#999933",
    marker="triangle-left",
    rounding="everything in single precision",
    requirement="sapien",
    settings="touchstone.adapters.engines.physx.settings:SETTINGS",
    lacks=(
        *("ellipsoids", "moving surfaces", "joints between bodies"),
        *("static friction", "rolling friction", "torsional friction"),
    ),
    pins=(
        "certifi==2026.10.19.post1",
        "charset-normalizer==3.5.3",
        "idna==3.20",
        "requests==2.34.2",
        "sapien==3.0.3",
        "transforms3d==0.4.2",
        "urllib3==2.8.0",
    ),
)
