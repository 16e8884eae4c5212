"""`check`: all checks of an engine, each with a time limit, in a child process."""

import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from touchstone.adapters.conformance import contacts, facts, motion
from touchstone.adapters.conformance.bench import Bench, ContractError
from touchstone.adapters.contract import Engine, Settings, Unsupported
from touchstone.adapters.registry import load, packages_of, profiles_of, registered
from touchstone.adapters.workers.process import ChildProcess, patience_of

PATIENCE = 60.0
"""Time for one check after which an engine that compiles nothing counts as hung [s]."""
LOAD_PATIENCE = 300.0
"""The same for the first check, which loads the engine."""
Check = Callable[[Bench], Iterator[str]]
CHECKS: dict[str, Check] = {
    "manifest": facts.manifest,
    "start": motion.start,
    "order": motion.order,
    "step": motion.step,
    "finite": motion.finite,
    "repetition": motion.repetition,
    "normals": contacts.normals,
    "stale contacts": contacts.stale,
    "coefficients": contacts.coefficients,
    "bounce": contacts.bounce,
    "driven": motion.driven,
}
Loader = Callable[[str], Engine]


@dataclass(frozen=True, slots=True)
class Report:
    """Outcome of one check: `faults` in words, or why the engine could not play its scenes."""

    check: str
    faults: tuple[str, ...] = ()
    skipped: str = ""


def check(
    name: str, profile: str = "", loader: Loader = load, patience: float = PATIENCE
) -> Iterator[Report]:
    """Check an engine under a profile ("": its first), one report per check. An engine that hangs in two is
    not asked again; faults of a check before are not told again.

    Raises AdapterError if the engine or the profile is unknown or the engine cannot be loaded.
    """
    name = registered(name)
    chosen = profile or next(iter(profiles_of(name)))
    settings = Settings(chosen, profiles_of(name, chosen)[chosen])
    with TemporaryDirectory() as folder:
        child: ChildProcess | None = None
        hung: list[str] = []
        told: dict[str, str] = {}
        for number, one in enumerate(CHECKS):
            if len(hung) == 2:
                yield Report(one, skipped=f"the engine hung in the checks {hung[0]!r} and {hung[1]!r}")
                continue
            if child is None:
                output = Path(folder, f"output{number}.txt")
                arguments = name, loader, settings
                child = ChildProcess(_Checker, arguments, output, patience, packages_of(name))
            child.send("check", one)
            answer = child.receive(max(patience_of(name), 0.0 if number else LOAD_PATIENCE))
            place = f"in the check {one!r}"
            if child.failure is not None:
                reason = child.failure[1].replace("during 'check'", place).replace("to 'check'", place)
                yield Report(one, (reason,))
                if child.failure[0] != "error":
                    return
                hung += [one] * child.hung
                child = None
            else:
                faults, skipped = answer
                again = dict.fromkeys(f"as in the check {told[fault]!r}" for fault in faults if fault in told)
                new = tuple(fault for fault in faults if fault not in told)
                yield Report(one, new, "; ".join(filter(None, (*again, skipped))))
                told = dict.fromkeys(faults, one) | told
        if child is not None:
            child.stop()


class _Checker:
    """Child's end: an engine, loaded at the first check."""

    def __init__(self, name: str, loader: Loader, settings: Settings) -> None:
        self._name, self._loader, self._settings = name, loader, settings
        self._bench: Bench | None = None

    def handle(self, command: str, argument: Any) -> tuple[tuple[str, ...], str]:
        """Run one check; returns its faults, and why it was skipped."""
        if self._bench is None:
            self._bench = Bench(self._loader(self._name), self._settings)
        return checked(CHECKS[argument], self._bench)


def checked(one: Check, bench: Bench) -> tuple[tuple[str, ...], str]:
    """Faults that a check finds, without repetition, and the reason why scenes were not played."""
    found: list[str] = []
    bench.unsupported.clear()
    try:
        for fault in one(bench):
            found.append(fault)
    except Unsupported as error:
        bench.unsupported.append(str(error))
    except ContractError as error:
        found.append(str(error))
    except Exception as error:
        found.append(f"{type(error).__name__}: {error}".partition("\n")[0] + _place(error))
    return tuple(dict.fromkeys(found)), "; ".join(dict.fromkeys(bench.unsupported))


def _place(error: BaseException) -> str:
    frame = traceback.extract_tb(error.__traceback__)[-1]
    return f" in `{frame.name}` ({frame.filename}, line {frame.lineno})"
