"""Table of MuJoCo Warp's settings that `--set` changes: those of MuJoCo, and the size of the batch."""

from touchstone.adapters.engines.mujoco.settings import SETTINGS as MUJOCO
from touchstone.adapters.engines.mujoco_warp import ENTRY
from touchstone.adapters.knobs import Range, Table

WORLDS = "worlds"
SETTINGS = Table(
    ENTRY.profiles,
    (
        *MUJOCO.values(),
        Range(WORLDS, 1, 4096, "", ("1",) * len(ENTRY.profiles), "equal worlds that are stepped together"),
    ),
)
