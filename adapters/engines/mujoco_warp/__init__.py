"""Adapter of MuJoCo Warp on the CPU, a second backend of MuJoCo; it plays when it is named."""

from dataclasses import replace

from touchstone.adapters.engines.mujoco import ENTRY as MUJOCO
from touchstone.adapters.engines.newton import ENTRY as NEWTON

SHARED = ("absl-py", "etils", "fsspec", "typing_extensions", "warp-lang", "zipp")
"""Packages whose pins are those of Newton."""
ENTRY = replace(
    MUJOCO,
    implementation="touchstone.adapters.engines.mujoco_warp.engine:MujocoWarpEngine",
    package="mujoco_warp",
    distribution="mujoco-warp",
    color="#DDCC77",
    marker="triangle-right",
    rounding="everything in single precision",
    requirement="mujoco-warp",
    compiles="touchstone.adapters.engines.mujoco_warp:compile_note",
    script="",
    settings="touchstone.adapters.engines.mujoco_warp.settings:SETTINGS",
    backend_of="mujoco",
    lacks=(*MUJOCO.lacks, "sleeping"),
    pins=("mujoco-warp==4.0.0", *(pin for pin in NEWTON.pins if pin.partition("==")[0] in SHARED)),
)


def compile_note() -> str:
    """What a scene that does not answer yet may wait for."""
    return "mujoco_warp: Warp compiles its kernels, some minutes, once"
