"""Stepping children: the frames of a world in order, timed; one that fails is one failure."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import frame_seconds, undisturbed
from touchstone.adapters.workers.stepping import Stepper


class World:
    """Notes what is done to it; a step takes a given time."""

    def __init__(self) -> None:
        self.calls: list[object] = []

    def drive(self, step: int) -> None:
        self.calls.append(step)

    def step(self) -> None:
        self.calls.append("step")


def test_a_frame_is_its_native_steps(lab, monkeypatch) -> None:
    """Time the step calls alone, each after its own drive, numbered through from the first frame."""
    ticks = iter(range(100))
    monkeypatch.setattr("touchstone.adapters.recorder.perf_counter", lambda: next(ticks))
    world = World()
    assert frame_seconds(world, lab.scene(lab.ball()), Settings("any", 1 / 240), 2) == 4
    assert world.calls == [8, "step", 9, "step", 10, "step", 11, "step"]


@pytest.mark.parametrize(
    ("switches", "reported", "asked"),
    [([5, 5], 3.0, 1), ([5, 6, 6, 6], 2.0, 2), ([*range(100)], 0.5, 10)],
    ids=["at once", "second", "never"],
)
def test_disturbed_times_do_not_count(monkeypatch, switches, reported, asked) -> None:
    """Take the first measurement without a switch of processes, or the least of ten."""
    counts = iter(switches)
    monkeypatch.setattr(
        "touchstone.adapters.recorder.getrusage", lambda who: type("Usage", (), {"ru_nivcsw": next(counts)})
    )
    times = [3.0, 2.0, 4.0, 0.5, *[5.0] * 10]
    measured = iter(times)
    taken = []

    def measure() -> float:
        taken.append(next(measured))
        return taken[-1]

    assert undisturbed(measure) == reported
    assert len(taken) == asked


@pytest.fixture
def stepper(tmp_path: Path, monkeypatch):
    """Children by the name of a fake engine; stopped at the end."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    from fake_engines import load as fakes

    children = []

    def start(name: str) -> Stepper:
        children.append(Stepper(name, tmp_path / f"{name}.txt", partial(fakes, str(tmp_path)), patience=20.0))
        return children[-1]

    yield start
    for child in children:
        child.stop()
    sys.modules.pop("fake_engines", None)


def test_frames_go_on_where_they_stopped(lab, tmp_path: Path, stepper) -> None:
    """Warm up, then play on; give the seconds of every frame asked for."""
    child = stepper("healthy")
    child.ask("load")
    child.ask("build", (lab.scene(lab.ball()), Settings("only", 1 / 120), 3))
    seconds = child.ask("frames", ("test", 4))
    assert child.failure is None
    assert len(seconds) == 4
    assert (np.asarray(seconds) > 0).all()


def test_a_failure_keeps_its_reason(lab, stepper) -> None:
    """Tell how an engine failed, and answer nothing from then on."""
    child = stepper("unsupported")
    child.ask("load")
    assert child.ask("build", (lab.scene(lab.ball()), Settings("only", 1 / 60), 1)) is None
    assert child.failure == ("skipped", "unsupported: no spheres")
    assert child.ask("frames", ("test", 4)) is None
