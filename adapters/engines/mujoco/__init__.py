"""Adapter of MuJoCo."""

from touchstone.adapters.engines.entry import ACCURATE, DEFAULT, EQUAL_STEP, RECOMMENDED, SLEEPING, Entry

ENTRY = Entry(
    "touchstone.adapters.engines.mujoco.engine:MujocoEngine",
    "mujoco",
    {
        RECOMMENDED: 1 / 540,
        "equal-step": EQUAL_STEP,
        DEFAULT: 1 / 540,
        ACCURATE: 1 / 1920,
        SLEEPING: 1 / 540,
    },
    color="#009E73",
    marker="diamond",
    rounding="vertices of hulls in single precision",
    requirement="mujoco",
    lacks=("static friction",),
    settings="touchstone.adapters.engines.mujoco.settings:SETTINGS",
    script="touchstone.adapters.engines.mujoco.script",
    # without them its broad phase leaves the narrow one 3.7 times the work in corner_slide: 285 us for 208
    keeps=("fixed",),
)
