"""Child processes: their start, their patience, one thread of linear algebra each."""

import os
import signal
import subprocess
import sys
import threading

import pytest

from touchstone.adapters.workers.process import THREADS, ChildProcess, interrupt_held, one_thread


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
    (tmp_path / "slow_server.py").write_text(f"import time\ntime.sleep(1.0)\n{server}")
    monkeypatch.syspath_prepend(tmp_path)
    from slow_server import Server

    child = ChildProcess(Server, (), tmp_path / "output.txt", patience=0.5)
    assert (child.ask("hello"), child.failure) == ("hello", None)
    child.stop()
