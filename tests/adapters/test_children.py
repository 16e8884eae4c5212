"""Children: one that fails is one column, turns are taken, output is kept apart, and nobody survives."""

import os
import signal
import sys
import time
from dataclasses import replace
from functools import partial
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest
from forked_children import fork_children

from touchstone.adapters.contract import Settings
from touchstone.adapters.recording import load
from touchstone.adapters.workers import process
from touchstone.adapters.workers.children import SLICE, Children, Job
from touchstone.scenarios.effects import PLANNED

FRAMES = 75
"""Two whole slices and a half."""
PATIENCE = 3.0
"""Seconds a child may take here: starting one takes half a second."""
SETTINGS = Settings("only", 1 / 60, effects=PLANNED)  # bodies sink through the ground
REASONS = {
    "throws on load": ("error", "RuntimeError: no such"),
    "cannot be imported": ("unimportable", "cannot be imported: libfake.so.3: no such file"),
    "throws": ("error", "ZeroDivisionError: one"),
    "reports": ("error", "reports: lost its way, in frame 40 at 0.6667 s"),
    "diverges": ("error", "diverged: the position of 'ball' is not finite, in frame 40 at 0.6667 s"),
    "speeds": ("error", "diverged: the linear velocity of 'ball' is 1e+30 m/s, in frame 40 at 0.6667 s"),
    "exits": ("error", "died during 'play': exit code 7"),
    "crashes": ("error", "died during 'play': signal SIGSEGV"),
    "unsupported": ("skipped", "unsupported: no spheres"),
    "prints": ("done", ""),
    "healthy": ("done", ""),
}


class Stage:
    """A folder, the jobs that play in it, and what the parent was told."""

    def __init__(self, folder, scenario):
        self.folder, self.scenario, self.progress = folder, scenario, []

    def jobs(self, names):
        paths = [(name, self.folder / f"{name}.npz", self.folder / f"{name}.txt") for name in names]
        return [Job(name, self.scenario, SETTINGS, npz, text) for name, npz, text in paths]

    def play(self, names, **options):
        from fake_engines import load as fakes

        reported = lambda label, frames: self.progress.append((label, frames))  # noqa: E731
        with Children(partial(fakes, str(self.folder)), **options) as children:
            outcomes = children.play(self.jobs(names), reported)
        return {outcome.job.engine: outcome for outcome in outcomes}

    def alive(self):
        return [path.stem for path in self.folder.glob("*.pid") if _runs(int(path.read_text()))]

    def steps(self):
        """(time, engine) of every step of the run proper, by time."""
        logs = [path.read_text() for path in self.folder.glob("*.log")]
        lines = [line.split() for log in logs for line in log.splitlines()]
        return sorted((int(line[0]), " ".join(line[1:-1])) for line in lines)


def _runs(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.fixture(scope="module", autouse=True)
def _importable():
    """Let this process and its children, which inherit its path, import the fake engines."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parent))
        yield
    sys.modules.pop("fake_engines", None)


@pytest.fixture(scope="module")
def scenario(lab):
    """A ball over the ground for two and a half slices."""
    return lab.scene(lab.ball(), lab.ground(), duration=FRAMES / 60)


@pytest.fixture(scope="module")
def ended(scenario, tmp_path_factory):
    """All the fakes that end by themselves, played together."""
    stage = Stage(tmp_path_factory.mktemp("ended"), scenario)
    with pytest.MonkeyPatch.context() as patch:
        fork_children(patch)
        return stage, stage.play(REASONS)


@pytest.mark.parametrize("name", REASONS)
def test_each_ends_in_its_own_way(ended, name):
    """Every misbehaviour ends in one outcome with one line of reason, and stops no other engine."""
    outcome = ended[1][name]
    assert (outcome.status, outcome.reason) == REASONS[name]


def test_what_was_played_is_recorded(ended):
    """The healthy ones' recordings are whole and their own; those that fail in a step leave what came before
    it with the reason; those whose process dies or that never play leave none, nor part of one."""
    stage, outcomes = ended
    whole, failed = {"healthy", "prints"}, {"throws", "reports", "diverges", "speeds"}
    assert {path.name for path in stage.folder.glob("*.npz*")} == {f"{name}.npz" for name in whole | failed}
    assert {name for name, outcome in outcomes.items() if outcome.recorded} == whole | failed
    for name in failed:
        kept = load(stage.folder / f"{name}.npz")
        assert kept.ended == outcomes[name].reason
        # the 40th step is the one that fails
        assert (kept.position[:, 0, 2] == -0.01 * np.arange(40)).all()
    for name in whole:
        kept = load(stage.folder / f"{name}.npz")
        assert kept.ended == ""
        assert kept.facts["engine"] == name
        assert kept.facts["settings"]["pid"] == int((stage.folder / f"{name}.pid").read_text())
        # exact: one product per frame
        assert (kept.position[:, 0, 2] == -0.01 * np.arange(FRAMES + 1)).all()


def test_no_child_survives(ended):
    """When play returns, no process of any child is left, whatever became of it."""
    assert ended[0].alive() == []


def test_output_goes_to_the_childs_file(capfd, scenario, tmp_path):
    """What an engine prints, natively or not, is in its file; tracebacks too; nothing reaches ours."""
    stage = Stage(tmp_path, scenario)
    capfd.readouterr()
    stage.play(["prints", "throws", "healthy"])
    assert capfd.readouterr() == ("", "")
    printed = (tmp_path / "prints.txt").read_text().splitlines()
    assert sorted(printed) == ["from Python", "native to stderr", "native to stdout"]
    traceback = (tmp_path / "throws.txt").read_text()
    assert "Traceback" in traceback
    assert "in misbehave" in traceback
    assert (tmp_path / "healthy.txt").read_text() == ""


def test_slices_are_interleaved(ended):
    """Engines take turns of SLICE frames and never work at the same time."""
    stage, _ = ended
    turns = [(name, len(list(steps))) for name, steps in groupby(stage.steps(), key=lambda step: step[1])]
    good = [turn for turn in turns if turn[0] in ("healthy", "prints")]
    lengths = [SLICE, SLICE, FRAMES - 2 * SLICE]
    assert good == [(name, length) for length in lengths for name in ("prints", "healthy")]
    # the broken ones end within their second turn; a turn that is cut in two would show as more
    assert len(turns) == 3 * 2 + 6 * 2


def test_together_is_at_the_same_time(ended, scenario, tmp_path, forked):
    """Leave the same recordings when all play at once, and work in each other's turns."""
    stage = Stage(tmp_path, scenario)
    names = ["healthy", "prints", "throws", "exits"]
    outcomes = stage.play(names, together=True)
    assert [(outcomes[name].status, outcomes[name].reason) for name in names] == [REASONS[n] for n in names]
    for name in ("healthy", "prints"):
        one, two = (load(folder / f"{name}.npz").position for folder in (tmp_path, ended[0].folder))
        np.testing.assert_array_equal(one, two)
    assert sum(frames for _, frames in stage.progress) == FRAMES * len(names)
    reported = [label for label, frames in stage.progress if not frames]
    # all are asked to play before the first has answered
    labels = [f"{name} {SETTINGS.label}" for name in names]
    assert reported[reported.index(labels[0]) :][:4] == labels
    assert stage.alive() == []


def test_progress_counts_every_frame_of_every_job(ended):
    """Progress adds up to all frames of all jobs, also of those that failed, so that a bar ends full."""
    assert sum(frames for _, frames in ended[0].progress) == FRAMES * len(REASONS)
    assert (f"healthy {SETTINGS.label}: save", 0) in ended[0].progress


def test_a_budget_ends_a_scene(scenario, tmp_path, forked):
    """One whose budget is used up leaves out the rest, and its recording is whole as far as it goes."""
    stage = Stage(tmp_path, scenario)
    plain = stage.jobs
    stage.jobs = lambda names: [replace(job, budget=1e-9) for job in plain(names)]
    assert stage.play(["healthy"])["healthy"].status == "done"
    kept = load(tmp_path / "healthy.npz")
    assert (len(kept.time), len(kept.time_frame)) == (2, 1)
    assert sum(frames for _, frames in stage.progress) == FRAMES


def test_a_hanging_engine_is_given_up_and_killed(scenario, tmp_path, forked):
    """One that does not answer is an error after the patience given, and another still finishes."""
    stage = Stage(tmp_path, scenario)
    start = time.monotonic()
    ended = stage.play(["hangs", "healthy"], patience=PATIENCE)
    assert ended["hangs"].status == "error"
    assert ended["hangs"].reason == f"hung: no answer to 'play' for {PATIENCE:g} s"
    assert ended["healthy"].status == "done"
    assert stage.alive() == []
    assert time.monotonic() - start > PATIENCE


def test_waiting_for_a_processor_is_no_hang(scenario, tmp_path, forked, monkeypatch):
    """A child whose processors other processes have is waited for."""
    monkeypatch.setattr(process, "queued_seconds", lambda pid: time.monotonic())
    ended = Stage(tmp_path, scenario).play(["slow"], patience=PATIENCE)
    assert ended["slow"].status == "done"


def test_an_error_in_the_parent_stops_the_children(scenario, tmp_path, forked):
    """An exception in the middle of the play, such as Ctrl-C, leaves no child behind."""
    stage = Stage(tmp_path, scenario)

    def interrupt(label, frames):
        if frames:
            raise KeyboardInterrupt

    stage.progress = type("Interrupting", (), {"append": staticmethod(lambda reported: interrupt(*reported))})
    with pytest.raises(KeyboardInterrupt):
        stage.play(["healthy", "prints"])
    assert len(list(tmp_path.glob("*.pid"))) == 2
    assert stage.alive() == []


def test_children_do_not_hear_ctrl_c(scenario, tmp_path):
    """A child that is sent SIGINT, even while it is starting, plays on: Ctrl-C is the parent's to handle."""
    stage = Stage(tmp_path, scenario)
    hit = []

    def hit_children(reported):
        if len(hit) < 40:
            children = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
            for child in map(int, children):
                if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
                    os.kill(child, signal.SIGINT)
                    hit.append(child)

    stage.progress = type("Hitting", (), {"append": staticmethod(hit_children)})
    ended = stage.play(["healthy"])
    assert hit
    assert (ended["healthy"].status, ended["healthy"].reason) == ("done", "")
    assert (tmp_path / "healthy.txt").read_text() == ""


def test_children_go_on_from_scene_to_scene(scenario, tmp_path):
    """A second scene is played by the same process with its own output; one that failed is replaced."""
    from fake_engines import load as fakes

    stage = Stage(tmp_path, scenario)
    names = ("healthy", "prints", "throws")
    with Children(partial(fakes, str(tmp_path))) as children:
        reported = []
        for folder in (tmp_path / "first", tmp_path / "second"):
            folder.mkdir()
            jobs = [Job(n, scenario, SETTINGS, folder / f"{n}.npz", folder / f"{n}.txt") for n in names]
            outcomes = children.play(jobs, lambda label, frames: None)
            reported.append({name: (tmp_path / f"{name}.pid").read_text() for name in names})
            assert [outcome.status for outcome in outcomes] == ["done", "done", "error"]
            assert load(folder / "healthy.npz").position.shape[0] == FRAMES + 1
            assert "native to stdout" in (folder / "prints.txt").read_text()
            assert "Traceback" in (folder / "throws.txt").read_text()
    first, second = reported
    assert [first[name] == second[name] for name in names] == [True, True, False]
    assert stage.alive() == []


def test_no_jobs_is_no_play(scenario):
    """Nothing to play gives nothing."""
    with Children() as children:
        assert children.play([], lambda label, frames: None) == []


def test_an_engine_that_hung_is_not_waited_for_again(scenario, tmp_path, forked):
    """Skip the scenes after one in which an engine hung, with its name; the others play on."""
    from fake_engines import load as fakes

    stage, quiet = Stage(tmp_path, scenario), lambda label, frames: None
    with Children(partial(fakes, str(tmp_path)), patience=PATIENCE) as children:
        children.play(stage.jobs(["hangs", "healthy"]), quiet)
        started = (tmp_path / "hangs.pid").stat().st_mtime_ns
        steps = [name for _, name in stage.steps()].count("hangs")
        ended = children.play(stage.jobs(["hangs", "healthy"]), quiet)
    assert (tmp_path / "hangs.pid").stat().st_mtime_ns == started
    assert [name for _, name in stage.steps()].count("hangs") == steps > 0
    assert [(one.job.engine, one.status, one.reason) for one in ended] == [
        ("hangs", "skipped", "not played: the engine hung in test"),
        ("healthy", "done", ""),
    ]


@pytest.mark.parametrize(
    ("compiles", "status"), [("builtins:str", "done"), pytest.param("", "error", marks=pytest.mark.slow)]
)
def test_compilation_has_a_patience_of_its_own(scenario, tmp_path, forked, monkeypatch, compiles, status):
    """Wait longer for commands that may compile, for engines that do; not for any other engine."""
    from fake_engines import load as fakes

    from touchstone.adapters.registry import ENGINES, Entry

    monkeypatch.setitem(ENGINES, "slow", Entry("", "", {}, compiles=compiles))
    stage = Stage(tmp_path, scenario)
    loader = partial(fakes, str(tmp_path))
    with Children(loader, patience=PATIENCE, compile_patience=3 * PATIENCE) as children:
        (ended,) = children.play(stage.jobs(["slow"]), lambda label, frames: None)
    assert ended.status == status
