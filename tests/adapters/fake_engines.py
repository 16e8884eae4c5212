"""Engines that misbehave in one way each, for spawned children: `partial(load, folder)` is their loader."""

import os
import signal
import time
from dataclasses import replace
from pathlib import Path

from fake_world import FakeWorld

from touchstone.adapters.contract import AdapterError, Unsupported

FALLS = 0.01
"""What a body sinks per step [m]."""


def load(folder: str, name: str) -> "Engine":
    """The engine called `name`; it writes its process and what it does into files of `folder`."""
    Path(folder, f"{name}.pid").write_text(str(os.getpid()))
    if name == "throws on load":
        raise RuntimeError("no such\nlibrary")
    if name == "cannot be imported":
        raise ImportError("libfake.so.3: no such file\nand more")
    if name == "dies on load":
        os.kill(os.getpid(), signal.SIGSEGV)
    if name == "hangs on load":
        time.sleep(600)
    return Engine(folder, name)


class Engine:
    """Sinks every body evenly, until it does what its name says."""

    def __init__(self, folder, name):
        self.folder, self.name = folder, name
        self.builds = 0

    def version(self):
        return "1.2.3"

    def build(self, scenario, settings):
        self.builds += 1
        if self.name == "slow" and self.builds == 1:
            time.sleep(4.0)  # longer than the patience of tests
        if self.name == "unsupported":
            raise Unsupported("unsupported: no spheres")
        return World(self, scenario, settings, warming=self.builds == 1)


class World(FakeWorld):
    """Does its worst in the 40th step of the run proper, in the second slice."""

    def __init__(self, engine, scenario, settings, warming):
        super().__init__(engine.name, scenario, settings)
        self.warming = warming
        self.log = open(Path(engine.folder, f"{engine.name}.log"), "a")  # noqa: SIM115

    def step(self):
        super().step()
        if self.warming:
            return
        print(time.monotonic_ns(), self.fake, self.steps, file=self.log, flush=True)
        if self.steps == 40:
            self.misbehave()

    def misbehave(self):
        match self.fake:
            case "throws":
                raise ZeroDivisionError("one\ntwo")
            case "reports":
                raise AdapterError("reports: lost its way")
            case "hangs":
                time.sleep(600)
            case "exits":
                os._exit(7)
            case "crashes":
                os.kill(os.getpid(), signal.SIGSEGV)
            case "prints":
                os.write(1, b"native to stdout\n")
                os.write(2, b"native to stderr\n")
                print("from Python")

    def read(self, state):
        state.position[:, 2] = -FALLS * self.steps
        if self.fake == "diverges" and self.steps == 40 and not self.warming:
            state.position[0, 0] = float("nan")
        if self.fake == "speeds" and self.steps == 40 and not self.warming:
            state.linear_velocity[0, 0] = 1e30

    def describe(self):
        return replace(super().describe(), settings={"pid": os.getpid()})

    def close(self):
        self.log.close()
