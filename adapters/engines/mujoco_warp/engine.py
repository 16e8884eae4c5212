"""MuJoCo Warp: the model that the adapter of MuJoCo compiles, stepped by Warp's kernels on the CPU in single
precision. Drives, contacts and manifests are those of that adapter, which reads MuJoCo's data from Warp's.

All pairs are explicit: of a direct solref, MuJoCo Warp does not heed the priority of geoms
(docs/findings/mujoco_warp.md). Room for contacts is not estimated from the start of a scene, as MuJoCo
Warp does: what exceeds it is dropped, and a run ends then.
https://mujoco.readthedocs.io/en/stable/mjwarp/index.html
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import version
from typing import Any, ClassVar

import mujoco
import mujoco_warp
import numpy as np
import warp

from touchstone.adapters.contract import AdapterError, Manifest, Scalar, Settings, State, Unsupported
from touchstone.adapters.engines.mujoco.engine import MujocoEngine, World
from touchstone.adapters.engines.mujoco_warp import ENTRY
from touchstone.adapters.engines.mujoco_warp.settings import SETTINGS, WORLDS
from touchstone.adapters.servo import Drive
from touchstone.scenarios.scenario import Scenario

CPU = "cpu"
CONTACTS_PER_GEOM = 32
"""Room for contacts [1]: four faces of boxes with eight points each."""
ROWS_PER_CONTACT = 10
"""Rows of a pyramid with rolling friction [1]."""
NO_RESET = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
"""Flag of the adapter of MuJoCo: a state that is not finite is kept."""
DRIVEN = ("qpos", "qvel", "qfrc_applied", "ctrl", "mocap_pos", "mocap_quat")
"""What a drive sets in MuJoCo's data."""


class MujocoWarpEngine(MujocoEngine):
    """MuJoCo Warp with the profiles of MuJoCo."""

    name: ClassVar[str] = "mujoco_warp"
    profiles: ClassVar[Mapping[str, float]] = ENTRY.profiles
    masks: ClassVar[bool] = False

    def __init__(self) -> None:
        warp.config.quiet = True

    def build(self, scenario: Scenario, settings: Settings) -> World:
        if settings.sleeping or settings.profile == "sleeping":
            raise Unsupported("mujoco_warp: no sleeping on the CPU")
        own = [text for text in settings.changes if text.startswith(f"{WORLDS}=")]
        self._worlds = int(SETTINGS.in_force(settings.profile, own)[WORLDS])
        shared = tuple(text for text in settings.changes if text not in own)
        try:
            return super().build(scenario, replace(settings, changes=shared))
        except NotImplementedError as error:
            raise Unsupported(f"mujoco_warp: {error}") from error

    def world_of(
        self, model: Any, body: list[int], scenario: Scenario, settings: Settings, drives: list[Drive]
    ) -> WarpWorld:
        return WarpWorld(model, body, scenario, settings, drives, self._worlds)

    def version(self) -> str:
        return version("mujoco-warp")


class WarpWorld(World):
    """MuJoCo's model and data, and those of Warp that follow them in equal worlds; the first is read."""

    def __init__(
        self,
        model: Any,
        body: list[int],
        scenario: Scenario,
        settings: Settings,
        drives: list[Drive],
        worlds: int,
    ) -> None:
        super().__init__(model, body, scenario, settings, drives)
        contacts = CONTACTS_PER_GEOM * max(int(model.ngeom), 1)
        flags = model.opt.disableflags
        model.opt.disableflags &= ~NO_RESET  # MuJoCo Warp resets nothing, and refuses the flag
        with warp.ScopedDevice(CPU):
            self._warp_model = mujoco_warp.put_model(model)
            model.opt.disableflags = flags
            room = {"nconmax": contacts, "njmax": ROWS_PER_CONTACT * contacts}
            self._warp_data = mujoco_warp.put_data(model, self._data, nworld=worlds, **room)
        self._worlds = worlds

    def drive(self, step: int) -> None:
        """Command the driven bodies in MuJoCo's data, and copy what that sets."""
        super().drive(step)
        if self._drives or self._posed:
            for name in DRIVEN:
                values = getattr(self._data, name)
                if values.size:
                    getattr(self._warp_data, name).assign(np.repeat(values[None], self._worlds, axis=0))

    def step(self) -> None:
        with warp.ScopedDevice(CPU):
            mujoco_warp.step(self._warp_model, self._warp_data)

    def read(self, state: State) -> None:
        """Read Warp's data into MuJoCo's, and that as the adapter of MuJoCo does."""
        data = self._warp_data
        if data.nacon.numpy()[0] > data.naconmax or data.nefc.numpy().max() > data.njmax:
            raise AdapterError("mujoco_warp: more contacts than there is room for; the others are dropped")
        mujoco_warp.get_data_into(self._data, self._model, data)
        super().read(state)

    def describe(self) -> Manifest:
        return replace(super().describe(), engine=MujocoWarpEngine.name, version=version("mujoco-warp"))

    def _facts(self) -> dict[str, Scalar]:
        return super()._facts() | {"warp": version("warp-lang"), "device": CPU, WORLDS: self._worlds}

    def cross(self) -> None:
        warp.is_cpu_available()

    def stage_seconds(self) -> Mapping[str, float]:
        """MuJoCo Warp reports none."""
        return {}

    def close(self) -> None:
        super().close()
        del self._warp_model, self._warp_data
