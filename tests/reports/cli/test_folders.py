"""The folder of results: whole, or not there."""

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

RUN = ("run", "ball_snip", "--engine", "reference", "--profile", "balanced")


def test_a_folder_in_use_is_refused(touchstone, tmp_path, left):
    """A folder that is not empty, or a file, is refused in one line before anything is played; it stays."""
    full = tmp_path / "full"
    full.mkdir()
    (full / "thesis.txt").write_text("kept")
    for out in (full, full / "thesis.txt"):
        code, _, err = touchstone(*RUN, "--out", out)
        assert code == 2
        assert err == f"touchstone: --out {out}: exists and is not an empty folder\n"
    assert (full / "thesis.txt").read_text() == "kept"
    assert left(tmp_path) == ["full"]


@pytest.mark.parametrize("out", ["file/below", ".", "..", "file/deep/er"])
def test_a_folder_that_cannot_be_is_one_line(touchstone, tmp_path, out, left):
    """A place where no folder can be is exit 2 and one line, and nothing is left."""
    (tmp_path / "file").write_text("a file")
    code, _, err = touchstone(*RUN, "--out", out)
    assert code == 2
    assert err.startswith(f"touchstone: --out {out}: ")
    assert err.count("\n") == 1
    assert left(tmp_path) == ["file"]


def test_a_full_disk_leaves_nothing_half_written(touchstone, quick, monkeypatch, tmp_path, left):
    """When the disk fills up while results are written: exit 2, one line, no part of the folder."""

    def full(self, path, **options):
        Path(path).write_bytes(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(pd.DataFrame, "to_parquet", full)
    code, out, err = touchstone(*RUN, "--out", "r", "--quiet")
    assert (code, out, err) == (2, "", "touchstone: --out r: No space left on device\n")
    assert left(tmp_path) == []


MARKER = "scene 1 of 1: ball_snip"


def interrupted(tmp_path, delay):
    """Run two engines in a session of their own, and send all of it SIGINT `delay` seconds after it prints
    MARKER."""
    arguments = [
        "run",
        "ball_snip",
        "--engine",
        "reference",
        "--engine",
        "mujoco",
        "--out",
        str(tmp_path / "r"),
    ]
    # where tests run in the background, SIGINT is ignored and children inherit that
    code = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
        f"sys.argv = ['touchstone', *{arguments}]; from touchstone.reports.cli.main import main; main()"
    )
    program = subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    reported = []
    for line in program.stderr:
        reported.append(line)
        if MARKER in line:
            break
    time.sleep(delay)
    os.killpg(program.pid, signal.SIGINT)
    out, err = program.communicate(timeout=60)
    return program, out, reported, err.splitlines()


def alive(session):
    """Processes of a session that still run."""
    found = []
    for process in filter(str.isdigit, os.listdir("/proc")):
        try:
            fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] not in "ZX":
            found.append(int(process))
    return found


@pytest.mark.parametrize("delay", [0.0, 1.0])
def test_ctrl_c_ends_everything_in_one_line(tmp_path, delay, left):
    """Ctrl-C, while children start or load their engines: exit 130, one line, no folder, no child left."""
    program, out, reported, err = interrupted(tmp_path, delay)
    assert program.returncode == 130
    assert out == ""
    # progress that was told meanwhile, then the one line
    assert err[-1] == "touchstone: interrupted; nothing was written"
    assert all(line.startswith(("scene ", "compiling ")) for line in err[:-1])
    assert MARKER in reported[-1]
    assert left(tmp_path) == []
    # multiprocessing's own tracker of resources ends a moment after its parent
    patience = time.monotonic() + 5
    while alive(program.pid) and time.monotonic() < patience:
        time.sleep(0.02)
    assert alive(program.pid) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no device that is always full")
@pytest.mark.parametrize("command", [["list", "engines"], ["show", "wall_push", "--format", "json"]])
def test_output_to_a_full_disk_is_one_line(command):
    """When standard output is full: exit 2 and one line, whether the write fails at once or at the end."""
    code = f"import sys; sys.argv = ['touchstone', *{command}]; "
    code += "from touchstone.reports.cli.main import main; main()"
    with open("/dev/full", "w") as full:
        done = subprocess.run([sys.executable, "-c", code], stdout=full, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (2, "touchstone: standard output: No space left on device\n")
