"""Adapter of Bullet through pybullet."""

from touchstone.adapters.engines.entry import (
    ACCURATE,
    DEFAULT,
    EQUAL_STEP,
    MAXIMAL,
    RECOMMENDED,
    SLEEPING,
    Entry,
)

ENTRY = Entry(
    "touchstone.adapters.engines.bullet.engine:BulletEngine",
    "pybullet",
    {
        RECOMMENDED: 1 / 240,
        "equal-step": EQUAL_STEP,
        DEFAULT: 1 / 240,
        ACCURATE: 1 / 960,
        MAXIMAL: 1 / 240,
        SLEEPING: 1 / 240,
    },
    color="#B8860B",
    marker="square",
    rounding="corners of hulls rounded to about 1e-4 of their size",
    requirement="pybullet",
    last_wheel=(3, 11),
    lacks=("ellipsoids", "static friction"),
    settings="touchstone.adapters.engines.bullet.settings:SETTINGS",
    script="touchstone.adapters.engines.bullet.script",
    # a step takes 0.97 to 1.03 of the time without parts of a table, another share in each process; a link
    # without shape is an empty compound to Bullet, whose box takes more instructions than that of a primitive
    # (0.7 % of a step of `spring`), and gravity is added to every link, be it zero (`slap_6`: 0.00 %)
    keeps=("met", "moving", "gravity"),
)
