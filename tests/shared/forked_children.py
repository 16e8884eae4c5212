"""Child processes that are forked in place of spawned, for tests that are about what children do."""

import faulthandler
import multiprocessing
import os
import sys
from multiprocessing.reduction import ForkingPickler
from types import SimpleNamespace

import pytest

from touchstone.adapters.workers import process


class Forks:
    """Context of child processes that have what this process has imported: a spawned one imports for 2 s."""

    Pipe = staticmethod(multiprocessing.get_context("fork").Pipe)

    @staticmethod
    def Process(target, args, daemon):
        """A process whose arguments are pickled as those of a spawned one."""
        pipe, *others = args
        others = ForkingPickler.loads(ForkingPickler.dumps(others))
        fork = multiprocessing.get_context("fork")
        return fork.Process(target=_forked, args=(target, pipe, *others), daemon=daemon)


def _forked(target, *args):
    """Print to the file descriptors, which pytest replaced; what it would print of a crash goes elsewhere."""
    faulthandler.disable()
    sys.stdout, sys.stderr = (os.fdopen(k, "w", closefd=False) for k in (1, 2))
    target(*args)


def fork_children(patch: pytest.MonkeyPatch) -> None:
    """Fork child processes until the patch ends."""
    forking = SimpleNamespace(**vars(multiprocessing) | {"get_context": lambda _: Forks})
    patch.setattr(process, "multiprocessing", forking)


@pytest.fixture
def forked(monkeypatch):
    """Fork child processes."""
    fork_children(monkeypatch)
