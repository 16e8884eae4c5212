"""The outermost frame of the program: signals, output streams, and exceptions that nobody expected.

However a command ends, it prints at most one line on standard error, and its exit code says why.
"""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NoReturn

import typer

from touchstone.reports.cli import options

UsageError: Any = typer.BadParameter.__base__
"""Base class of all usage errors; typer does not export it."""
ENDING = (signal.SIGTERM, signal.SIGHUP)
"""Signals that end a run as Ctrl-C does: a job's end, and a terminal that closes."""


def guarded(program: Callable[[], int | None]) -> NoReturn:
    """Run the program and exit: every expected failure ends in one line on standard error."""
    open_streams()
    if not sys.warnoptions:  # those of libraries are for programmers; a verdict says what is wrong
        warnings.simplefilter("ignore")
    received = handle_signals()
    code: int | None = options.INTERNAL_ERROR
    kept = "nothing was written"
    try:
        code = program()
        sys.stdout.flush()
    except UsageError as error:
        if type(error).__name__ == "NoArgsIsHelpError":  # it has printed the help
            sys.exit(options.BAD_INPUT)
        message, context = error.format_message().replace("Value error, ", ""), getattr(error, "ctx", None)
        what = " ".join(message.split())
        command = context.command_path if context else "touchstone"
        options.stop(f"{what.rstrip('.')} (see {command} --help)")
    except options.Interrupted as error:
        code, kept = options.INTERRUPTED, str(error)
    except SystemExit as end:
        # typer turns a closed pipe into an exit of its own, with the code of a broken limit
        if isinstance(end.__context__, BrokenPipeError):
            _end_output(end.__context__)
        raise
    except (KeyboardInterrupt, typer.Abort):
        code = options.INTERRUPTED
    except OSError as error:
        _end_output(error)
    except Exception as error:
        _internal(error)
    if code == options.INTERRUPTED:
        options.stop(f"interrupted; {kept}", 128 + received[0] if received else options.INTERRUPTED)
    sys.exit(code)


def open_streams() -> None:
    """Give the program standard streams that write UTF-8 in any locale; closed ones discard what they get."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # The lowest free descriptor is `number`; child processes need it, and pipes must not get it.
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            # The file stays open as long as the process.
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        stream = getattr(sys, name)
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(encoding="utf-8", errors="backslashreplace")


def handle_signals() -> list[int]:
    """Handle the ENDING signals as Ctrl-C; returns a list to which the handler adds the signal.

    A signal that the caller ignores (`nohup`) stays ignored. The first one counts: further ones must not
    interrupt the clean-up.
    """
    received: list[int] = []

    def end(number: int, _: object) -> None:
        for one in ENDING:
            signal.signal(one, signal.SIG_IGN)
        received.append(number)
        raise KeyboardInterrupt

    for number in ENDING:
        with suppress(ValueError):  # not in the main thread
            if signal.getsignal(number) == signal.SIG_DFL:
                signal.signal(number, end)
    return received


def _end_output(error: OSError) -> NoReturn:
    """End after a failure to write: a closed pipe in silence, a full disk with one line."""
    with suppress(OSError, ValueError):
        # Discard the remaining output.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    if error.errno == errno.EPIPE:
        sys.exit(options.CLOSED_OUTPUT)
    place = error.filename or "standard output"
    with suppress(OSError):  # standard error may be full, too
        print(f"touchstone: {place}: {error.strerror or error}", file=sys.stderr)
    sys.exit(options.BAD_INPUT)


def _internal(error: Exception) -> NoReturn:
    """End after a fault of the program itself: the traceback in a file, one line that names it."""
    import tempfile
    import traceback

    what = f"internal error: {type(error).__name__}: {error}".splitlines()[0]
    with suppress(OSError):
        number, path = tempfile.mkstemp(prefix="touchstone-error-", suffix=".txt")
        with open(number, "w", encoding="utf-8") as file:
            file.write("".join([" ".join(sys.argv), "\n", *traceback.format_exception(error)]))
        what += f" (traceback: {path})"
    with suppress(OSError):
        print(f"touchstone: {what}", file=sys.stderr)
    sys.exit(options.INTERNAL_ERROR)
