"""Calls of pip that install into folders of the user's cache, and why they fail in one line."""

import os
import re
import subprocess
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from touchstone.adapters.workers.orphans import end_with_parent

NEWEST = 6
"""Number of released versions that a message lists [1]."""


def cache_folder(kind: str) -> Path:
    """Folder in the user's cache."""
    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(home) / "touchstone" / kind


def pip_fault(arguments: Sequence[str], name: str, python: Path | None = None) -> str:
    """Install by pip; why it failed in one line, or "". pip ends with this process.

    Args:
        arguments: of `pip install`.
        name: what a message calls the package.
        python: interpreter of the environment that gets it; None: this one's.
    """
    call = [sys.executable, "-m", "pip", *(["--python", str(python)] if python else []), "install"]
    call += ["--disable-pip-version-check", "--no-input", "--quiet", *arguments]
    tied = partial(end_with_parent, os.getpid(), True) if sys.platform == "linux" else None
    done = subprocess.run(
        call,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        encoding="utf-8",
        errors="replace",
        preexec_fn=tied,
    )
    return pip_reason(done.stderr, name) if done.returncode else ""


def pip_reason(text: str, name: str) -> str:
    """Why pip failed, in one line, from its messages."""
    if "No module named pip" in text:
        return f"pip is missing: {sys.executable} -m ensurepip"
    released = re.search(r"from versions: ([^)]*)\)", text)
    if released:
        versions = [one.strip() for one in released[1].split(",")]
        if versions != ["none"]:
            return f"does not exist for this interpreter; newest: {', '.join(versions[-NEWEST:])}"
        return f"pip finds no {name}: it is not released, or there is no connection"
    if "ResolutionImpossible" in text or "conflict" in text.lower():
        return "cannot be installed beside numpy and scipy of this program"
    causes = re.findall(r"^\s*(\w*(?:Error|Exception): .+|ERROR: .+)$", text, re.MULTILINE)
    own = [cause for cause in causes if not cause.startswith("ERROR:")]
    reason = (own or causes or [text.strip() or "pip said nothing"])[-1]
    return f"cannot be built: {' '.join(reason.split())[:160]}"
