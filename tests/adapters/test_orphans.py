"""Processes and folders of a parent that was killed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from touchstone.adapters.workers.scratch import Claimed, claimed_folder, locked, scratch_folder, sweep

HERE = Path(__file__).parent
HANGING = """
import sys, threading
sys.path.insert(0, {here!r})
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


def soon(condition, patience=20.0):
    """Whether a condition becomes true."""
    end = time.monotonic() + patience
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
    program = HANGING.format(here=str(HERE), folder=str(tmp_path), start=start)
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
