"""Pool of child processes that share a list of tasks, and the processes that play them with engines.

All parallel play that is not timed runs here. Timed play takes turns: runs have one process per engine and
profile (`children.py`), other tasks an `EngineProcess` per engine.
"""

import gc
import queue
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from touchstone.adapters.contract import UNIMPORTABLE, AdapterError, Engine, Settings
from touchstone.adapters.registry import load, packages_of
from touchstone.adapters.workers.process import (
    PATIENCE,
    STARTING,
    ChildProcess,
    failure_of,
    patience_of,
    pin,
)

Child = TypeVar("Child", bound=ChildProcess)
Task = TypeVar("Task")
Result = TypeVar("Result")
Loader = Callable[[str], Engine]


class Stopped(Exception):
    """The pool has ended while a task was played."""


class Slot(Generic[Child]):
    """Place of one process, which is started when it is needed and replaced once it has failed."""

    def __init__(self, start: Callable[[], Child]) -> None:
        self._start = start
        self._child: Child | None = None
        self._stopped = False

    def child(self) -> Child:
        """The process; a new one if there is none or if it has failed. Raises Stopped after `stop`."""
        if self._child is None or self._child.failure is not None:
            self._child = None if self._stopped else self._start()
        if self._stopped:
            self.stop()
            raise Stopped
        assert self._child is not None
        return self._child

    def stop(self) -> None:
        """End the process, if there is one, and start no other."""
        self._stopped = True
        if self._child is not None:
            self._child.stop()


class Pool(Generic[Child]):
    """Slots that take tasks from one list.

    Args:
        start: starts a process whose output goes to the given file.
        count: largest number of processes.
        folder: of the files of output, `worker-1.txt` and so on.
    """

    def __init__(self, start: Callable[[Path], Child], count: int, folder: Path) -> None:
        def starter(file: Path) -> Callable[[], Child]:
            return lambda: start(file)

        self._slots = [Slot(starter(folder / f"worker-{k + 1}.txt")) for k in range(count)]
        self._lock = threading.Lock()
        self._stopped = False

    def each(
        self, tasks: Iterable[Task], play: Callable[[Slot[Child], Task], Iterable[Result]]
    ) -> Iterator[Result]:
        """Play all tasks, once; yields results in the order in which they end.

        A task is taken from `tasks` when a slot is free. `play` runs in one thread per slot; what it raises
        ends the pool. Where the caller stops early, all processes end at once.
        """
        source = iter(tasks)
        ended: queue.SimpleQueue[tuple[str, Any]] = queue.SimpleQueue()

        def serve(slot: Slot[Child]) -> None:
            try:
                for task in iter(lambda: self._take(source), None):
                    for result in play(slot, task):
                        ended.put(("result", result))
                ended.put(("done", None))
            except BaseException as error:
                ended.put(("error", error))

        try:
            for slot in self._slots:
                threading.Thread(target=serve, args=(slot,), daemon=True).start()
            left = len(self._slots)
            while left:
                kind, value = ended.get()
                if kind == "error":
                    raise value
                if kind == "done":
                    left -= 1
                else:
                    yield value
        finally:
            self._stopped = True
            for slot in self._slots:
                slot.stop()
            with STARTING:  # a process that starts now reads what it is to do, and ends
                pass

    def _take(self, source: Iterator[Task]) -> Task | None:
        with self._lock:
            return None if self._stopped else next(source, None)


class EngineTask(Protocol):
    """What an `EngineProcess` plays."""

    @property
    def engine(self) -> str:
        """Name of the engine."""

    @property
    def settings(self) -> Settings:
        """How to run it."""


HANG, CRASH = "hang", "crash"


@dataclass(frozen=True, slots=True)
class Ended:
    """Verdict and reason of a task without a result; `process`: HANG or CRASH if that ended its process."""

    status: str
    reason: str
    process: str = ""


class EngineProcess(ChildProcess):
    """Process that keeps engines loaded. Commands: `play` (task), answered by `play(engine, task)` or Ended;
    `load` (task), its engine alone. With `core`, tasks are played on that processor."""

    def __init__(
        self,
        play: Callable[..., object],
        output: Path,
        loader: Loader = load,
        patience: float = PATIENCE,
        core: int | None = None,
    ) -> None:
        super().__init__(EngineServer, (play, loader, core), output, patience)
        self._at_least = 0.0
        self._played: set[str] = set()

    def send(self, command: str, argument: Any = None) -> None:
        """Send a task to a process that finds its engine; the first that it plays may compile."""
        self.turn_to(packages_of(argument.engine))
        self._at_least = 0.0 if argument.engine in self._played else patience_of(argument.engine)
        if command == "play":
            self._played.add(argument.engine)
        super().send(command, argument)

    def receive(self, at_least: float = 0.0, waiting: Callable[[], None] | None = None) -> Any:
        """Result of the last task, or Ended."""
        found = super().receive(max(at_least, self._at_least), waiting)
        return found if self.failure is None else Ended(*self.failure, HANG if self.hung else CRASH)


class EngineServer:
    """The child's end: engines, loaded once each. What a task raises ends that task alone."""

    def __init__(self, play: Callable[..., object], loader: Loader, core: int | None = None) -> None:
        self._play, self._loader, self._core = play, loader, core
        self._engines: dict[str, Engine] = {}

    def handle(self, command: str, task: EngineTask) -> object:
        """Play a task, or load its engine."""
        try:
            if task.engine not in self._engines:
                self._engines[task.engine] = self._loader(task.engine)
            if command == "load":
                gc.freeze()  # a collection of all that was imported would disturb times
                return None
            if self._core is not None:
                pin(self._core)
            return self._play(self._engines[task.engine], task)
        except Exception as error:
            if not isinstance(error, AdapterError | ImportError):
                traceback.print_exc()
            return Ended(*failure_of(error))


def played_in_pool(
    play: Callable[[Engine, Any], object],
    tasks: Sequence[EngineTask],
    folder: Path,
    processes: int,
    loader: Loader = load,
    patience: float = PATIENCE,
) -> Iterator[tuple[int, Any]]:
    """Number and result of `play(engine, task)`, or Ended, of each task in the order in which they end.

    A process that a task ends is replaced. An engine that cannot be imported is tried once.
    """
    unimportable: dict[str, Ended] = {}

    def one(slot: Slot[EngineProcess], number: int) -> list[tuple[int, object]]:
        engine = tasks[number].engine
        found = unimportable.get(engine) or slot.child().ask("play", tasks[number])
        if isinstance(found, Ended) and found.status == UNIMPORTABLE:
            unimportable[engine] = found
        return [(number, found)]

    def start(output: Path) -> EngineProcess:
        return EngineProcess(play, output, loader, patience)

    return Pool(start, min(processes, len(tasks)), folder).each(range(len(tasks)), one)
