"""Print a digest of every scene's recording in every profile of an engine.

Before and after a change that must not change results, in each checkout:

    .venv/bin/python tests/shared/recording_digests.py > digests.txt

and compare the two files with `diff`. Times are no part of a digest.

Arguments: `--engine NAME` (default: reference), names of scenes (default: those of at most MOST_BODIES bodies
and SEEDS random ones).
"""

import argparse
import hashlib
from collections.abc import Iterator

import numpy as np

from touchstone.adapters.contract import AdapterError, Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import ENGINES, load
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.random_scenes import random_scene
from touchstone.scenarios.scenario import Scenario

MOST_BODIES = 40
SEEDS = range(10)
FIELDS = (
    "position",
    "orientation",
    "linear_velocity",
    "angular_velocity",
    "joint_angle",
    "joint_rate",
    "contacts",
    "work",
)
"""What is compared: the state of each frame, the contacts, and what the engine counted."""


def digest(scenario: Scenario, profile: str, engine: str = "reference") -> str:
    """Hash of what an engine does with a scene, or why it stops (hex)."""
    settings = Settings(profile, ENGINES[engine].profiles[profile])
    found = hashlib.sha256()
    try:
        recording = record(load(engine), scenario, settings)
    except AdapterError as error:
        return f"error: {error}"
    for name in FIELDS:
        found.update(np.ascontiguousarray(getattr(recording, name)).tobytes())
    return found.hexdigest()[:16]


def chosen(names: list[str]) -> Iterator[Scenario]:
    """The scenes to play."""
    scenes = catalogue()
    if names:
        yield from (scenes[name] for name in names)
        return
    yield from (scene for scene in scenes.values() if len(scene.bodies) <= MOST_BODIES)
    yield from (random_scene(seed) for seed in SEEDS)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--engine", default="reference", choices=list(ENGINES))
    parser.add_argument("scene", nargs="*")
    asked = parser.parse_args()
    for scenario in chosen(asked.scene):
        for profile in ENGINES[asked.engine].profiles:
            found = digest(scenario, profile, asked.engine)
            print(f"{scenario.name:28} {profile:11} {found}", flush=True)
