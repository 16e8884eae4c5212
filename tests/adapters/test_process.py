"""Child processes: one thread of linear algebra each."""

from __future__ import annotations

import os
import subprocess
import sys

from touchstone.adapters.workers.process import THREADS, one_thread


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
