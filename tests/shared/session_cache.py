"""Answers that all workers of a test session share: what one of them computed, the others read from disk.

The folder belongs to one session, so that no answer outlives the code that gave it.
"""

import fcntl
import hashlib
import pickle
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

RECENT = 32
"""Answers that a process keeps in memory [-]: a recording of a tower has up to 50 MB of contacts."""


class SessionCache:
    """Computes what no process of the session has computed before, and reads the rest."""

    def __init__(self, folder: Path) -> None:
        """Use a folder that all processes of the session share."""
        self._folder = folder
        self._recent: OrderedDict[str, Any] = OrderedDict()

    def get(self, key: str, compute: Callable[[], Any]) -> Any:
        """The answer of `compute()`, which must be picklable; nothing is kept of one that raises.

        Args:
            key: all that the answer depends on, but for the code.
        """
        name = hashlib.sha256(key.encode()).hexdigest()[:24]
        if name not in self._recent:
            self._recent[name] = self._shared(name, compute)
            if len(self._recent) > RECENT:
                self._recent.popitem(last=False)
        self._recent.move_to_end(name)
        return self._recent[name]

    def _shared(self, name: str, compute: Callable[[], Any]) -> Any:
        path = self._folder / name
        with _locked(path.with_suffix(".lock")):
            if path.exists():
                return pickle.loads(path.read_bytes())
            answer = compute()
            path.write_bytes(pickle.dumps(answer, protocol=5))
            return answer


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Let one process at a time do what follows; one that dies releases the lock."""
    with open(path, "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
