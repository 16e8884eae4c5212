"""Child processes: start, patience, one thread each, the pool, and what a killed parent leaves."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from fake_server import DEADLY, EXIT_CODE, Squares, naps, nothing

from touchstone.adapters.contract import Unsupported
from touchstone.adapters.engines.entry import ENGINES, Entry
from touchstone.adapters.workers.pool import HANG, EngineProcess, Pool, Slot, Stopped
from touchstone.adapters.workers.process import THREADS, ChildProcess, failure_of, interrupt_held, one_thread
from touchstone.adapters.workers.scratch import Claimed, claimed_folder, locked, scratch_folder, sweep


def test_ctrl_c_that_another_thread_receives_is_held_back() -> None:
    """Blocked in the main thread, Ctrl-C reaches any other thread: what starts is started, then it counts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    other, done = threading.Event(), []
    thread = threading.Thread(target=other.wait)
    thread.start()

    def start() -> None:
        with interrupt_held():
            signal.pthread_kill(thread.ident, signal.SIGINT)
            other.set()
            thread.join()
            done.append("started")

    try:
        with pytest.raises(KeyboardInterrupt):
            start()
    finally:
        other.set()
        signal.signal(signal.SIGINT, before)
    assert done == ["started"]


def test_children_have_one_thread_and_the_parent_keeps_its_own(monkeypatch) -> None:
    """Tell children of one thread, whatever the parent was told, and leave the parent's environment alone."""
    monkeypatch.setenv(THREADS[0], "7")
    monkeypatch.delenv(THREADS[1], raising=False)
    code = f"import os; print([os.environ[name] for name in {THREADS}])"
    with one_thread():
        child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert child.stdout.strip() == str(["1"] * len(THREADS))
    assert os.environ[THREADS[0]] == "7"
    assert THREADS[1] not in os.environ


def test_patience_counts_from_the_start_of_the_child(tmp_path, monkeypatch) -> None:
    """A child whose imports take longer than its patience, and that answers at once, does not hang."""
    server = "class Server:\n    def handle(self, command, _):\n        return command\n"
    (tmp_path / "slow_server.py").write_text(f"import time\ntime.sleep(3.0)\n{server}")
    monkeypatch.syspath_prepend(tmp_path)
    from slow_server import Server

    child = ChildProcess(Server, (), tmp_path / "output.txt", patience=2.0)
    assert (child.ask("hello"), child.failure) == ("hello", None)
    child.stop()


def test_only_the_first_task_of_an_engine_that_compiles_may_take_longer(tmp_path, monkeypatch) -> None:
    """Where its kernels are not compiled yet it answers after its patience; what follows hangs by then."""
    task = SimpleNamespace(engine="naps")
    monkeypatch.setitem(ENGINES, "naps", Entry("", "", {}, compiles="builtins:str"))
    child = EngineProcess(naps, tmp_path / "output.txt", nothing, patience=0.5)
    assert child.ask("play", task) == "answer"
    assert child.ask("play", task).process == HANG
    monkeypatch.setitem(ENGINES, "naps", Entry("", "", {}))
    child = EngineProcess(naps, tmp_path / "output.txt", nothing, patience=0.5)
    assert child.ask("play", task).process == HANG


def test_a_reason_is_one_line() -> None:
    """A message of several lines, as MuJoCo's compiler raises, is joined."""
    error = Unsupported("mujoco: Error: inertia must have positive eigenvalues\nElement name '1', id 2\n")
    assert failure_of(error) == (
        "skipped",
        "mujoco: Error: inertia must have positive eigenvalues; Element name '1', id 2",
    )


def start(output: Path) -> ChildProcess:
    """A process that squares."""
    return ChildProcess(Squares, (), output, 30.0)


def square(slot: Slot[ChildProcess], number: int) -> list[tuple[int, object]]:
    """A number with its square and process, or why there is none."""
    child = slot.child()
    found = child.ask("square", number)
    return [(number, found if child.failure is None else child.failure[1])]


def alive(process: int) -> bool:
    """Whether a process exists."""
    return Path(f"/proc/{process}").exists()


def test_tasks_end_once_whatever_dies(tmp_path: Path) -> None:
    """Two processes share eight tasks; the one that dies costs its task and is replaced."""
    main = dict(vars(sys.modules["__main__"]))
    found = list(Pool(start, 2, tmp_path).each(range(8), square))
    assert sorted(number for number, _ in found) == list(range(8))
    answers = dict(found)
    assert answers.pop(DEADLY) == f"died during 'square': exit code {EXIT_CODE}"
    assert {number: one[0] for number, one in answers.items()} == {n: n**2 for n in range(8) if n != DEADLY}
    processes = {one[1] for one in answers.values()}
    assert 1 <= len(processes) <= 3
    assert not any(map(alive, processes))
    # two threads start processes at once, and each hides the main module meanwhile
    assert vars(sys.modules["__main__"]).get("__file__") == main.get("__file__")


def test_an_early_end_stops_processes_and_takes_no_more_tasks(tmp_path: Path, monkeypatch) -> None:
    """A caller that leaves the loop leaves no process, and a slot starts no other."""
    taken: list[int] = []
    slots: list[Slot[ChildProcess]] = []
    stop, second, stopped = Slot.stop, threading.Event(), threading.Event()
    monkeypatch.setattr(Slot, "stop", lambda slot: (stop(slot), stopped.set()))

    def tasks():
        for number in range(100, 200):
            taken.append(number)
            yield number

    def noting(slot, number):
        slots.append(slot)
        if number > 100:
            second.set()
            stopped.wait()
        return square(slot, number)

    results = Pool(start, 1, tmp_path).each(tasks(), noting)
    process = next(results)[1][1]
    second.wait()
    results.close()
    assert not alive(process)
    assert taken == [100, 101]
    with pytest.raises(Stopped):
        slots[0].child()


@pytest.mark.parametrize("where", ["tasks", "play"])
def test_an_error_reaches_the_caller(tmp_path: Path, where: str) -> None:
    """What the list of tasks or the function raises is raised where results are read."""

    def tasks():
        yield 1
        if where == "tasks":
            raise ZeroDivisionError(where)

    def play(slot, number):
        if where == "play":
            raise ZeroDivisionError(where)
        return [number]

    with pytest.raises(ZeroDivisionError, match=where):
        list(Pool(start, 2, tmp_path).each(tasks(), play))


HERE = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "shared")]
"""Folders of the fakes."""
HANGING = """
import sys, threading
sys.path[:0] = {here!r}
from functools import partial
from pathlib import Path
from fake_engines import load
from touchstone.adapters.workers.import_check import _Importer
from touchstone.adapters.workers.process import ChildProcess

def start():
    global child
    child = ChildProcess(_Importer, (partial(load, {folder!r}),), Path({folder!r}, "out.txt"), 600)
    child.send("import", "hangs on load")
    child.receive()

if __name__ == "__main__":
    {start}
"""
HOLDING = """
import sys, time
from pathlib import Path
from touchstone.adapters.workers.scratch import claimed_folder
with claimed_folder(Path(sys.argv[1])) as folder:
    (folder / "half.txt").write_text("half")
    print("held", flush=True)
    time.sleep(600)
"""

ADDING = """
import sys
from touchstone.adapters.workers.own_environment import OwnEnvironment
own = OwnEnvironment("owned", ("nothing==1.0",))
print(own.folder, flush=True)
own.add()
"""
SLOW_PIP = """
import os, sys, time
from pathlib import Path
Path(sys.argv[sys.argv.index("--target") + 1], "half").write_text(str(os.getpid()))
time.sleep(float(os.environ["SECONDS"]))
"""


def soon(condition):
    """Whether a condition becomes true; the patience is that of a busy machine."""
    end = time.monotonic() + 300.0
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()


def running(process):
    """Whether a process exists and is no zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


@pytest.mark.parametrize(
    "start", ["start()", "threading.Thread(target=start).start()"], ids=["main", "thread"]
)
def test_a_hung_child_ends_with_its_killed_parent(tmp_path, start):
    """Kill -9 of a parent whose engine hangs ends the child, whichever thread of the parent started it."""
    program = HANGING.format(here=HERE, folder=str(tmp_path), start=start)
    parent = subprocess.Popen([sys.executable, "-c", program])
    pid = tmp_path / "hangs on load.pid"
    assert soon(lambda: pid.exists() and pid.read_text())
    child = int(pid.read_text())
    assert running(child)
    parent.kill()
    parent.wait()
    assert soon(lambda: not running(child))


def test_a_folder_of_a_dead_process_is_taken_over(tmp_path):
    """Refuse a folder whose process lives; take it over, empty, once that process was killed."""
    place = tmp_path / "claimed"
    holder = subprocess.Popen([sys.executable, "-c", HOLDING, str(place)], stdout=subprocess.PIPE)
    assert holder.stdout.readline() == b"held\n"
    sweep(tmp_path, "*")
    with pytest.raises(Claimed), claimed_folder(place):
        pass
    assert (place / "half.txt").exists()
    holder.kill()
    holder.wait()
    with claimed_folder(place) as folder:
        assert list(folder.iterdir()) == []
        assert locked(folder) is None
    assert not place.exists()


def test_scratch_folders_of_dead_processes_are_removed(tmp_path, monkeypatch):
    """The next scratch folder removes those of processes that were killed, and none of living ones."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    program = (
        "import os, signal, sys, tempfile; tempfile.tempdir = sys.argv[1]\n"
        "from touchstone.adapters.workers.scratch import scratch_folder\n"
        "with scratch_folder() as folder: os.kill(os.getpid(), signal.SIGKILL)"
    )
    assert subprocess.run([sys.executable, "-c", program, tmp_path]).returncode == -signal.SIGKILL
    (dead,) = tmp_path.iterdir()
    with scratch_folder() as living, scratch_folder() as second:
        assert living.exists()
        assert sorted(tmp_path.iterdir()) == sorted([living, second])
    assert not dead.exists()
    assert os.listdir(tmp_path) == []


def test_a_killed_installation_leaves_no_environment(tmp_path):
    """Kill -9 half-way ends pip too, and leaves no environment; the next installation removes the part."""
    (tmp_path / "pip.py").write_text(SLOW_PIP)
    cache = tmp_path / "cache"
    given = os.environ | {"PYTHONPATH": str(tmp_path), "XDG_CACHE_HOME": str(cache)}
    call = [sys.executable, "-c", ADDING]
    parent = subprocess.Popen(call, env=given | {"SECONDS": "600"}, stdout=subprocess.PIPE, text=True)
    place = Path(parent.stdout.readline().strip())
    half = place.with_name(f".{place.name}.part") / "half"
    assert soon(lambda: half.exists() and half.read_text())
    pip = int(half.read_text())
    parent.kill()
    parent.wait()
    assert soon(lambda: not running(pip))
    assert not place.exists()
    subprocess.run(call, env=given | {"SECONDS": "0"}, check=True, capture_output=True)
    assert list(place.parent.iterdir()) == [place]
    assert [path.name for path in place.iterdir()] == ["half"]
