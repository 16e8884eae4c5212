"""Scripts and lines of settings of any engine, written in a child process: an engine may print or crash."""

import importlib
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from touchstone.adapters.contract import AdapterError, Array, Settings, Unsupported
from touchstone.adapters.recorder import planned_for
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import ENGINES, installed, missing_reason
from touchstone.adapters.scripts.script import moments, moving, text_of
from touchstone.adapters.workers.process import PATIENCE, ChildProcess
from touchstone.adapters.workers.scratch import scratch_folder
from touchstone.scenarios.avatar.kinematics import matrix
from touchstone.scenarios.scenario import Scenario

MOST_SECONDS = 300.0
"""Time for a script to run [s]."""


@dataclass(frozen=True, slots=True)
class Script:
    """A script: its text, what pip installs for it, and whether it prints centres of mass."""

    text: str
    requirement: str
    of_mass: bool


def written(scenario: Scenario, engine: str, settings: Settings, head: Sequence[str] = ()) -> Script:
    """The script that plays a scene as the adapter of an engine does.

    Args:
        head: lines of its docstring.
    Raises:
        AdapterError: the engine writes no scripts, is not installed, or cannot represent the scene.
    """
    if scenario.body_joints:
        raise Unsupported(f"{engine}: no words for joints between bodies")
    found: Script = _asked(engine, "script", (scenario, settings, tuple(head) or (scenario.name,)))
    return found


def settings_lines(scenario: Scenario, engine: str, several: Iterable[Settings]) -> list[list[str]]:
    """Per settings the lines that set them in an engine's own API, as scripts of the scene have them.

    Settings that the engine refuses in the scene have none.

    Raises:
        AdapterError: the engine writes no scripts, or is not installed.
    """
    found: list[list[str]] = _asked(engine, "lines", (scenario, tuple(several)))
    return found


def _asked(engine: str, command: str, argument: tuple[Any, ...]) -> Any:
    entry = ENGINES[engine]
    if not entry.script:
        able = ", ".join(name for name, one in ENGINES.items() if one.script)
        raise Unsupported(f"{engine}: no scripts in its own API are written for it; for {able} they are")
    if not installed(engine):
        raise AdapterError(f"{engine}: {missing_reason(engine)}")
    with scratch_folder() as folder:
        child = ChildProcess(_Writer, (engine, entry.script), Path(folder, "output.txt"), PATIENCE)
        try:
            found = child.ask(command, argument)
        finally:
            child.stop()
        if child.failure is not None:
            raise AdapterError(child.failure[1])
    return found


class _Writer:
    """Child's end."""

    def __init__(self, engine: str, module: str) -> None:
        self._engine = engine
        self._module: Any = importlib.import_module(module)

    def handle(self, command: str, argument: Any) -> object:
        if command == "lines":
            scenario, several = argument
            return [self._lines(scenario, one) for one in several]
        scenario, settings, head = argument
        scene, settings, _ = planned_for(self._engine, scenario, settings)
        parts = self._module.parts(scene, settings)
        return Script(text_of(parts, scene, settings, head), parts.requirement, parts.of_mass)

    def _lines(self, scenario: Scenario, settings: Settings) -> list[str]:
        try:
            scene, settings, _ = planned_for(self._engine, scenario, settings)
            found: list[str] = self._module.settings_lines(scene, settings)
        except AdapterError:
            return []
        return found


def run(script: Path) -> str:
    """What a script prints; raises AdapterError with its last line of error."""
    call = [sys.executable, str(script.resolve())]
    try:
        # engines write logs to the current folder
        with scratch_folder() as folder:
            done = subprocess.run(
                call, cwd=folder, capture_output=True, text=True, timeout=MOST_SECONDS, check=False
            )
    except subprocess.TimeoutExpired as error:
        raise AdapterError(f"{script}: did not end within {MOST_SECONDS:g} s") from error
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
        raise AdapterError(f"{script}: {lines[-1]}")
    return done.stdout


def distance(printed: str, recording: Recording, scenario: Scenario, of_mass: bool) -> float:
    """Largest difference of a coordinate [m] between what a script printed and the recording; 0: to the bit.

    Compares the frames that the recording has: a run that diverged ends early.

    Raises:
        AdapterError: the script did not print these frames and bodies.
    """
    found: dict[tuple[int, str], Array] = {}
    for line in printed.splitlines():
        if not line.startswith(" ") and line.count(" ") >= 4:
            time, x, y, z, name = line.split(" ", 4)
            if name in {scenario.bodies[k].name for k in moving(scenario)}:
                found[round(float(time) * scenario.frame_rate), name] = np.array([x, y, z], dtype=float)
    frames = [frame for frame in moments(scenario) if frame < len(recording.position)]
    largest = 0.0
    for frame in frames:
        for k in moving(scenario):
            name = scenario.bodies[k].name
            if (frame, name) not in found:
                raise AdapterError(f"the script printed no position of {name!r} at frame {frame}")
            place = recording.position[frame, k]
            if of_mass:
                place = place + matrix(recording.orientation[frame, k]) @ scenario.bodies[k].center_of_mass
            largest = max(largest, float(np.abs(found[frame, name] - place).max()))
    return largest
