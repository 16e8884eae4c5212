"""The program called in an empty folder; recordings whose metrics are known in closed form."""

import multiprocessing
import shlex
import sys
from io import StringIO
from types import SimpleNamespace

import numpy as np
import pytest
from forked_children import fork_children

from touchstone.adapters.workers import process
from touchstone.adapters.workers.pool import EngineServer
from touchstone.reports.cli import main as cli
from touchstone.reports.metrics import METRICS
from touchstone.reports.metrics.context import Context, NotMeasured
from touchstone.reports.runner.tasks import Task
from touchstone.reports.studies import study
from touchstone.reports.views.render import FittingConsole, print_parts
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.scenario import Body, Piece, Sphere
from touchstone.scenarios.solids import sphere_inertia

G = 9.81
RADIUS = 0.05
"""Of the ball of `lab.ball` [m]."""
SLOWEST = 1e-3
"""Speed of the slowest bounce [m/s]."""


@pytest.fixture(scope="module", autouse=True)
def all_forked():
    """Fork child processes, those of fixtures of a module too."""
    with pytest.MonkeyPatch.context() as patch:
        fork_children(patch)
        yield


@pytest.fixture(autouse=True)
def spawned_where_marked(request, monkeypatch):
    """Spawn child processes in tests that are marked `spawned`."""
    if request.node.get_closest_marker("spawned"):
        monkeypatch.setattr(process, "multiprocessing", multiprocessing)


@pytest.fixture
def touchstone(monkeypatch, capfd, tmp_path):
    """Call the program in this process, in an empty folder: (exit code, stdout, stderr).

    The first argument is a line of words as a shell splits them; others are words as they are.
    """

    monkeypatch.chdir(tmp_path)

    def call(line="", *words):
        monkeypatch.setattr(sys, "argv", ["touchstone", *shlex.split(line), *map(str, words)])
        capfd.readouterr()
        with pytest.raises(SystemExit) as end:
            cli.main()
        return (end.value.code or 0, *capfd.readouterr())

    return call


@pytest.fixture
def refused(touchstone):
    """Call the program with bad input, which ends in exit 2 and one line: what it says."""

    def call(*arguments):
        code, out, err = touchstone(*arguments)
        assert (code, out, err.count("\n")) == (2, "", 1), err
        start, _, said = err.rstrip("\n").partition(": ")
        assert start == "touchstone"
        return said

    return call


@pytest.fixture
def without_coal(monkeypatch):
    """The library that measures overlap cannot be imported."""
    for name in [name for name in sys.modules if name.startswith("touchstone.adapters.oracles")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "coal", None)


@pytest.fixture
def in_this_process(monkeypatch):
    """Let a study play tasks in this process on engines that all are installed: a function records a task."""

    def patch(module, record):
        monkeypatch.setattr(Task, "record", lambda task, engine: record(task))
        for one in (module, study):
            monkeypatch.setattr(one, "installed", lambda engine: True)
        monkeypatch.setattr(
            module,
            "played",
            lambda play, tasks, *_: [EngineServer(play, str).handle("play", task) for task in tasks],
        )

    return patch


@pytest.fixture(scope="session")
def shown():
    """What a report prints on a terminal of so many columns."""

    def show(parts, width=112):
        out = StringIO()
        print_parts(parts, FittingConsole(width=width, file=out))
        return out.getvalue()

    return show


def bouncing(times, height, restitution):
    """Gap [m] and velocity [m/s] of a ball dropped at rest from `height` over the ground, bouncing."""
    fall = (2 * height / G) ** 0.5
    gaps, speeds = np.zeros(len(times)), np.zeros(len(times))
    for k, t in enumerate(times):
        start, up = -fall, G * fall  # as if thrown up by the ground one fall earlier
        while t > start + 2 * up / G and up > 0:
            start, up = start + 2 * up / G, restitution * up if restitution * up > SLOWEST else 0.0
        if up > 0:
            gaps[k], speeds[k] = up * (t - start) - G / 2 * (t - start) ** 2, up - G * (t - start)
    return gaps, speeds


def path(scenario, index, position=None, velocity=None, orientation=None, spin=None):
    """Columns of a recording in which one body moves as given and the others stand."""
    frames, bodies = scenario.frame_count + 1, scenario.bodies
    columns = {
        name: np.tile([getattr(body, name) for body in bodies], (frames, 1, 1))
        for name in ("position", "orientation")
    }
    columns |= {name: np.zeros_like(columns["position"]) for name in ("linear_velocity", "angular_velocity")}
    for name, given in zip(columns, (position, orientation, velocity, spin)):
        if given is not None:
            columns[name][:, index] = given
    return columns


def ideal(recordings, scenario, **columns):
    """A recording in which every body moves as its truth says; other columns as given."""
    times = np.arange(scenario.frame_count + 1) / scenario.frame_rate
    kept = path(scenario, 0)
    for truth in scenario.truths:
        moved, k = motion(scenario, truth, times), scenario.body_index(truth.body)
        kept["position"][:, k], kept["linear_velocity"][:, k] = moved.position, moved.velocity
        kept["orientation"][:, k], kept["angular_velocity"][:, k] = moved.orientation, moved.angular_velocity
    return recordings.recording(scenario, **(kept | columns))


def hand(mass=1.0):
    """A driven ball of 1 cm."""
    tip = (Piece("tip", Sphere(0.01)),)
    return Body("hand", "driven", "wood", tip, mass, inertia=sphere_inertia(mass, 0.01))


def value(name, recording, scenario):
    """What a metric says: subject -> value."""
    return dict(METRICS[name].measure(Context(recording, scenario)))


def unmeasured(name, recording, scenario):
    """Why a metric is not measured."""
    with pytest.raises(NotMeasured) as reason:
        value(name, recording, scenario)
    return str(reason.value)


@pytest.fixture(scope="session")
def known() -> SimpleNamespace:
    """The builders of this file."""
    builders = {one.__name__: one for one in (bouncing, path, ideal, hand, value, unmeasured)}
    return SimpleNamespace(**builders, g=G, radius=RADIUS)
