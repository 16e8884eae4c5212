"""Spawned child processes, one per engine, that play probes and return motions: a crash costs one row."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from touchstone.adapters.contract import AdapterError, Array, Engine, Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import load
from touchstone.adapters.workers.process import PATIENCE, ChildProcess
from touchstone.reports.studies.calibration.scenes import HEIGHT, Probe, scene

Loader = Callable[[str], Engine]


class Motion(NamedTuple):
    """Motion of a probe's bodies (b) at every step (n): heights over the floor (n, b) [m], and velocities of
    the centre and of the surface point that touches the floor (n, b, 3) [m/s]."""

    gap: Array
    velocity: Array
    surface: Array


class Child(ChildProcess):
    """The parent's end of an engine."""

    def __init__(self, name: str, output: Path, loader: Loader = load, patience: float = PATIENCE) -> None:
        super().__init__(_Server, (name, loader), output, patience)
        self.name = name


class _Server:
    """The child's end: an engine."""

    def __init__(self, name: str, loader: Loader) -> None:
        self._name, self._loader = name, loader

    def handle(self, command: str, argument: tuple[Probe, Settings]) -> object:
        """Handle `load`, then `play`, repeatedly; a probe that fails gives its status and reason."""
        if command == "load":
            self._engine = self._loader(self._name)
            return self._engine.version()
        try:
            return motion_of(self._engine, *argument)
        except AdapterError as error:
            return error.status, str(error)


def motion_of(engine: Engine, probe: Probe, settings: Settings) -> Motion:
    """Play a probe's scene and return its motion."""
    played = record(engine, scene(probe, settings.dt), settings)
    # All bodies but the floor; the surface point is the one under the centre.
    velocity, omega = played.linear_velocity[:, 1:], played.angular_velocity[:, 1:]
    surface = velocity + np.cross(omega, (0.0, 0.0, -HEIGHT))
    return Motion(played.position[:, 1:, 2] - HEIGHT, velocity, surface)
