"""Child processes that end with their parent, even when it is killed while an engine hangs."""

import ctypes
import os
import signal
import sys
import threading
import time

PR_SET_PDEATHSIG = 1
"""Number of the request in <sys/prctl.h>."""
WATCH = 0.5
"""Interval at which a child checks its parent where the kernel does not notify it [s]."""


def end_with_parent(parent: int, by_kernel: bool) -> None:
    """Make this process end as soon as the process `parent` does.

    Args:
        parent: process id of the parent that started this process.
        by_kernel: let Linux kill this process, which also ends native code that hangs. Linux does so when the
            *thread* that started it ends; start processes from the main thread, or pass False.
    """
    if by_kernel and sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    else:
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()
    if os.getppid() != parent:  # it ended before the request
        os._exit(1)


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(WATCH)
    os._exit(1)
