"""Server of a child process for tests of pools: squares of numbers."""

import os
import time
from importlib.metadata import version

DEADLY = 3
"""Number that kills the process."""
EXIT_CODE = 7
NAP = 3.0
"""Time of a slow answer [s]."""


class Squares:
    """Child's end."""

    def handle(self, command: str, number: int) -> tuple[int, int]:
        """Return the square and the process that computed it."""
        if number == DEADLY:
            os._exit(EXIT_CODE)
        return number**2, os.getpid()


def library_version(engine, task) -> str:
    """Version of a library in the process that plays a task."""
    return version(task.library)


def naps(engine: None, task: object) -> str:
    """An answer that takes NAP seconds."""
    time.sleep(NAP)
    return "answer"


def nothing(name: str) -> None:
    """No engine."""
