"""Scenes of a Python file: its functions marked `@scene`, as in `scenarios/families/`.

The file is executed in a process of its own, which it may end: its scenes come back pickled.
"""

import faulthandler
import importlib.util
import os
import pickle
import re
import signal
import subprocess
import sys
from contextlib import suppress
from importlib.machinery import SourceFileLoader
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType

from touchstone.scenarios.catalogue import scenes_of
from touchstone.scenarios.scenario import HOLD_LAST, Scenario

Scenes = tuple[dict[str, Scenario], list[str]]
CHILD = """import pickle, sys
sys.path[:], *request = pickle.load(sys.stdin.buffer)
from touchstone.scenarios.files.python_file import answer
answer(*request)
"""
"""Program of the process: the request comes over its standard input."""
ANSWER, CRASH = "scenes", "crash"
"""Files that the process writes: its answer, and where native code was called that ended it."""
UNSENT = "a scene cannot be sent to another process"
FRAME = re.compile(r'File "(.+)", line (\d+)')


def scenes_of_python(path: Path) -> Scenes:
    """Scenes of a Python file by name, and a line for each function or import that fails. The file is
    executed; its own folder is on the import path meanwhile, and what it prints goes to standard error."""
    with TemporaryDirectory() as folder:
        request = pickle.dumps((sys.path, path, HOLD_LAST.get(), folder))
        code = subprocess.run([sys.executable, "-c", CHILD], input=request, stdout=2).returncode
        if (written := Path(folder, ANSWER)).exists():
            try:
                found: Scenes = pickle.loads(written.read_bytes())
            except Exception as error:  # of a class that only the file knows
                return {}, [f"{path}: {UNSENT}: {error}"]
            return found
        crash = Path(folder, CRASH)
        lines = FRAME.findall(crash.read_text("utf-8", "replace")) if crash.exists() else []
    line = next((f":{number}" for file, number in lines if Path(file) == path), "")
    end = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
    return {}, [f"{path}{line}: it ends the process that reads it: {end}"]


def answer(path: Path, hold_last: bool, folder: str) -> None:
    """The process's end: write the scenes of a file, or what is wrong with it, to a file of a folder."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the caller's, which ends this process
    with Path(folder, CRASH).open("w", encoding="utf-8") as crash:
        faulthandler.enable(crash)
        HOLD_LAST.set(hold_last)
        found, broken = _executed(path)
        try:
            text = pickle.dumps((found, broken))
        except Exception as error:  # engines play in processes of their own, too
            text = pickle.dumps(({}, [f"{path}: {UNSENT}: {error}"]))
        Path(folder, ANSWER).write_bytes(text)
        with suppress(OSError, ValueError):  # closed by the file
            sys.stdout.flush()
        os._exit(0)  # what the file left behind, such as threads, does not matter


def _executed(path: Path) -> Scenes:
    name = f"touchstone_scene_{path.stem}"

    def load() -> ModuleType:
        spec = importlib.util.spec_from_loader(name, SourceFileLoader(name, str(path)))
        module = importlib.util.module_from_spec(spec)  # type: ignore[arg-type]
        SourceFileLoader(name, str(path)).exec_module(module)
        return module

    sys.path.insert(0, str(path.resolve().parent))
    return scenes_of(load, str(path), also=(BaseException,))
