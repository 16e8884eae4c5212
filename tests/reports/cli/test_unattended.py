"""Runs that nobody watches, and their folders: signals, streams, locales, collisions, full disks, faults."""

import errno
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
import typer

from touchstone.reports.cli import main as cli
from touchstone.reports.cli.options import folder_of_now, version
from touchstone.reports.output_folder import OutputError, output_folder
from touchstone.reports.progress import ABOUT, COMPILING, SCENE
from touchstone.reports.run import study

RUN = "run ball_snip --engine reference --profile balanced"
LONG = "run --tag gallery --engine reference"
"""Takes minutes: it does not end before its signal, whatever else a machine does."""
MARKER = "scene 1 of "
CALL = "import sys; sys.argv[0] = 'touchstone'; from touchstone.reports.cli.main import main; main()"
# whoever runs the tests may ignore SIGHUP, as nohup does, or SIGINT, as what runs in the background
HEARD = (
    "import signal; signal.signal(signal.SIGHUP, signal.SIG_DFL); "
    "signal.signal(signal.SIGINT, signal.default_int_handler); "
)


def program(command, stdout=None):
    """Start the program in a session of its own."""
    return subprocess.Popen(
        [sys.executable, "-c", HEARD + CALL, *shlex.split(command)],
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


WRITING = """
import os, signal, sys
from pathlib import Path
from touchstone.reports.output_folder import output_folder
with output_folder(Path(sys.argv[1])):
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_run_leaves_nothing_to_its_successor(tmp_path, left, touchstone, quick):
    """Kill -9 leaves a hidden folder; the next run in the same place removes it and finishes."""
    done = subprocess.run([sys.executable, "-c", WRITING, str(tmp_path / "r")])
    assert (done.returncode, left(tmp_path)) == (-signal.SIGKILL, [".r.touchstone-part"])
    assert touchstone(f"{RUN} --out s --quiet")[0] == 0
    assert left(tmp_path) == ["s"]


KEPT = """
import os, signal, time, typer
from pathlib import Path
from touchstone.reports.cli.guard import guarded
from touchstone.reports.cli.options import resumable
app = typer.Typer()
@app.command()
def measure() -> None:
    with resumable(Path("runs/sweep")):
        os.kill(os.getpid(), signal.NAME)
        time.sleep(60)
guarded(lambda: app([], standalone_mode=False))
"""


@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
def test_an_interrupted_sweep_says_what_is_kept(name, code):
    """The last line names the store, and the exit code the signal."""
    text = HEARD + KEPT.replace("NAME", name)
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True)
    line = "touchstone: interrupted; what was measured is kept in runs/sweep, the same command goes on"
    assert (done.returncode, done.stderr.splitlines()[-1]) == (code, line)


def test_two_runs_do_not_collide(tmp_path, refused, left):
    """A second run into a folder that is being written is refused at once; default names differ."""
    with output_folder(tmp_path / "r") as part:
        (part / "kept.txt").write_text("kept")
        with (
            pytest.raises(OutputError, match="another run that is still alive writes it"),
            output_folder(tmp_path / "r"),
        ):
            pass
        assert "another run that is still alive writes it" in refused(f"{RUN} --out r")
    assert left(tmp_path / "r") == ["kept.txt"]
    other = subprocess.run(
        [sys.executable, "-c", "from touchstone.reports.cli.options import folder_of_now as f; print(f())"],
        capture_output=True,
        text=True,
        check=True,
    )
    process = f"-{os.getpid()}"
    assert process in folder_of_now().name
    assert process not in other.stdout
    assert folder_of_now() != folder_of_now()


@pytest.mark.parametrize("locale", [{"LC_ALL": "C"}, {"PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}])
def test_output_is_utf8_in_any_locale(locale):
    """Print UTF-8 whatever the locale says, without an error."""
    code = "from touchstone.reports.cli.guard import guarded; guarded(lambda: print('\\u2717 \\u03bc'))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, env=os.environ | locale)
    assert (done.returncode, done.stdout.decode(), done.stderr) == (0, "\u2717 \u03bc\n", b"")


@pytest.mark.parametrize(
    "closed",
    [
        pytest.param(">&-", marks=pytest.mark.slow),
        pytest.param(">&- 2>&-", marks=pytest.mark.slow),
        "2>/dev/full",
    ],
)
def test_closed_or_full_streams_are_no_traceback(closed, tmp_path):
    """A closed standard output or error, or a full one, changes neither the files nor the exit code."""
    line = f'"{sys.executable}" -c "{CALL}" list engines > "{tmp_path}/out" {closed}'
    done = subprocess.run(["sh", "-c", line], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    for refused in ("show none.toml", "list nothing"):
        line = f'"{sys.executable}" -c "{CALL}" {refused} {closed}'
        done = subprocess.run(["sh", "-c", line], capture_output=True, text=True)
        assert (done.returncode, "Traceback" in done.stderr) == (2, False)


@pytest.mark.parametrize("closed", [">&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_child_processes_have_streams_where_ours_are_closed(closed):
    """A child process gets the null device, so that it can divert its output."""
    child = "import sys; sys.exit(None in (sys.stdin, sys.stdout, sys.stderr))"
    code = (
        "import subprocess, sys; from touchstone.reports.cli.guard import guarded; "
        f"guarded(lambda: subprocess.call([sys.executable, '-c', '{child}']))"
    )
    line = shlex.join([sys.executable, "-c", code])
    assert subprocess.run(["sh", "-c", f"{line} {closed}"], stderr=subprocess.DEVNULL).returncode == 0


@pytest.mark.parametrize("command", ["list engines", "schema"])
def test_a_reader_that_stops_is_no_error(command):
    """`| head` is exit 141 in silence."""
    running = program(command, stdout=subprocess.PIPE)
    running.stdout.close()  # as head does after its lines
    assert (running.wait(), running.stderr.read()) == (141, "")


def test_an_internal_error_has_its_code_and_a_file(touchstone, monkeypatch, tmp_path):
    """A fault of the program is exit 70 and one line that names the file of its traceback."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))

    def fails(*arguments):
        raise ZeroDivisionError("a fault\nof two lines")

    monkeypatch.setattr(study, "run", fails)
    code, out, err = touchstone(f"{RUN} --out r")
    assert (code, out, err.count("\n")) == (70, "", 1)
    start, _, path = err.partition(" (traceback: ")
    assert start == "touchstone: internal error: ZeroDivisionError: a fault"
    text = Path(path.strip().removesuffix(")")).read_text()
    assert text.startswith("touchstone run ball_snip")
    assert "in fails" in text


def test_measurements_survive_a_page_that_fails(touchstone, quick, monkeypatch):
    """Where the report cannot be written, the table and the recordings are kept, and the exit code is 70."""

    def fails(request, results):
        raise KeyError("cell")

    monkeypatch.setattr(study, "report", fails)
    code, _, err = touchstone(f"{RUN} --out r --quiet")
    assert code == 70
    assert err == "report.md could not be written; results are stored: KeyError: 'cell'\n"
    assert len(pd.read_parquet("r/results.parquet")) > 20
    assert Path("r/recordings/ball_snip-reference-balanced.npz").exists()


def test_one_line_per_scene_off_a_terminal(touchstone, quick):
    """Progress in a file: a line per scene and not one per engine and command."""
    _, _, err = touchstone(f"{RUN} fall --out r")
    assert err.splitlines()[:2] == ["scene 1 of 2: ball_snip", "scene 2 of 2: fall"]


def test_version_help_and_completion(touchstone, monkeypatch):
    """`--version` prints one line, `-h` is `--help` in every command, and shells can complete names."""
    assert touchstone("--version") == (0, f"touchstone {version()}\n", "")
    for command in ("", "run", "study", "study convergence"):
        assert touchstone(f"{command} -h") == touchstone(f"{command} --help")
    monkeypatch.setenv("_TOUCHSTONE_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "touchstone do")
    monkeypatch.setenv("COMP_CWORD", "1")
    assert "doctor" in touchstone()[1]
    assert isinstance(cli.app, typer.Typer)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no device that is always full")
@pytest.mark.parametrize(
    ("redirected", "code", "said"),
    [("2>&1 | true", 141, ""), ("> /dev/full", 2, "touchstone: standard output: No space left on device")],
)
def test_results_outlive_their_reader(tmp_path, redirected, code, said):
    """Results are stored where standard output is closed or full while scenes are shown; the code says so."""
    call = f'"{sys.executable}" -c "{CALL}" {RUN.replace("ball_snip", "fall")} --out r'
    line = f"set -o pipefail; {call} {redirected}"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, cwd=tmp_path)
    errors = [text for text in done.stderr.splitlines() if text.startswith("touch")]
    assert (done.returncode, errors) == (code, [said] if said else [])
    assert len(pd.read_parquet(tmp_path / "r" / "results.parquet")) > 20


def test_a_full_disk_leaves_nothing_half_written(refused, quick, monkeypatch, tmp_path, left):
    """When the disk fills up while results are written: exit 2, one line, no part of the folder."""

    def full(self, path, **options):
        Path(path).write_bytes(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(pd.DataFrame, "to_parquet", full)
    assert refused(f"{RUN} --out r --quiet") == "--out r: No space left on device"
    assert left(tmp_path) == []


def soon(condition):
    """Whether a condition becomes true, on a busy machine too."""
    end = time.monotonic() + 300
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()


def compiles(process):
    """Whether a process has loaded the compiler of the reference."""
    try:
        return "llvmlite" in Path(f"/proc/{process}/maps").read_text()
    except OSError:
        return False


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


@pytest.mark.parametrize("loading", [False, True])
def test_ctrl_c_ends_everything_in_one_line(tmp_path, loading, left):
    """Ctrl-C, while children start or load their engines: exit 130, one line, no folder, no child left."""
    running = program(f"{LONG} --engine mujoco --out '{tmp_path}/r'", stdout=subprocess.PIPE)
    assert any(MARKER in line for line in running.stderr)
    if loading:
        assert soon(lambda: any(map(compiles, set(alive(running.pid)) - {running.pid})))
    os.killpg(running.pid, signal.SIGINT)
    out, err = running.communicate()
    assert (running.returncode, out) == (130, "")
    # progress that was told meanwhile, then the one line
    *told, last = err.splitlines()
    assert last == "touchstone: interrupted; nothing was written"
    assert all(line.startswith((SCENE, ABOUT, COMPILING)) for line in told)
    assert left(tmp_path) == []
    # multiprocessing's own tracker of resources ends a moment after its parent
    assert soon(lambda: not alive(running.pid))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no device that is always full")
@pytest.mark.parametrize("command", ["list engines", "schema"])
def test_output_to_a_full_disk_is_one_line(command):
    """When standard output is full: exit 2 and one line, whether the write fails at once or at the end."""
    with open("/dev/full", "w") as full:
        running = program(command, stdout=full)
    _, err = running.communicate()
    assert (running.returncode, err) == (2, "touchstone: standard output: No space left on device\n")
