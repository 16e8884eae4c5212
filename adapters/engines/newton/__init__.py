"""Adapter of Newton, which plays when it is named, in an environment of its own: it needs another MuJoCo."""

from touchstone.adapters.engines.entry import Entry

XPBD, MUJOCO, ELLIPTIC, STEEL, KAMINO = "xpbd", "mujoco", "mujoco-elliptic", "steel", "kamino"
ENTRY = Entry(
    "touchstone.adapters.engines.newton.engine:NewtonEngine",
    "newton",
    {XPBD: 1 / 600, MUJOCO: 1 / 600, ELLIPTIC: 1 / 600, STEEL: 1 / 240, KAMINO: 1 / 300},
    color="#882255",
    marker="wedge",
    rounding="everything in single precision",
    requirement="newton",
    compiles="touchstone.adapters.engines.newton:compile_note",
    settings="touchstone.adapters.engines.newton.settings:SETTINGS",
    lacks=(
        *("moving surfaces", "joints between bodies", "sleeping"),
        *("static friction", "rolling friction", "torsional friction"),
    ),
    pins=(
        "absl-py==2.5.1",
        "etils==1.15.0",
        "fsspec==2026.9.0",
        "glfw==2.11.0",
        "mujoco==3.17.0",
        "mujoco-warp==3.17.0",
        "newton==1.8.0",
        "PyOpenGL==3.1.10",
        "typing_extensions==4.16.0",
        "warp-lang==1.19.0",
        "zipp==4.1.2",
    ),
)


def compile_note() -> str:
    """What a scene that does not answer yet may wait for."""
    return "newton: Warp compiles its kernels, one to two minutes for each solver, once"
