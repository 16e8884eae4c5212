"""Pool of child processes: each task ends once, a process that dies is replaced, and none is left over."""

import sys
from pathlib import Path
from time import sleep

import pytest
from fake_server import DEADLY, EXIT_CODE, Squares

from touchstone.adapters.workers.pool import Pool, Slot, Stopped
from touchstone.adapters.workers.process import ChildProcess


def start(output: Path) -> ChildProcess:
    """A process that squares."""
    return ChildProcess(Squares, (), output, 30.0)


def square(slot: Slot[ChildProcess], number: int) -> list[tuple[int, object]]:
    """A number with its square and process, or why there is none."""
    child = slot.child()
    found = child.ask("square", number)
    return [(number, found if child.failure is None else child.failure[1])]


def alive(process: int) -> bool:
    """Whether a process exists."""
    return Path(f"/proc/{process}").exists()


def test_tasks_end_once_whatever_dies(tmp_path: Path) -> None:
    """Two processes share eight tasks; the one that dies costs its task and is replaced."""
    main = dict(vars(sys.modules["__main__"]))
    found = list(Pool(start, 2, tmp_path).each(range(8), square))
    assert sorted(number for number, _ in found) == list(range(8))
    answers = dict(found)
    assert answers.pop(DEADLY) == f"died during 'square': exit code {EXIT_CODE}"
    assert {number: one[0] for number, one in answers.items()} == {n: n**2 for n in range(8) if n != DEADLY}
    processes = {one[1] for one in answers.values()}
    assert 1 <= len(processes) <= 3
    assert not any(map(alive, processes))
    # two threads start processes at once, and each hides the main module meanwhile
    assert vars(sys.modules["__main__"]).get("__file__") == main.get("__file__")


def test_an_early_end_stops_processes_and_takes_no_more_tasks(tmp_path: Path) -> None:
    """A caller that leaves the loop leaves no process, and a slot starts no other."""
    taken: list[int] = []
    slots: list[Slot[ChildProcess]] = []

    def tasks():
        for number in range(100, 200):
            taken.append(number)
            yield number

    def noting(slot, number):
        slots.append(slot)
        if number > 100:
            # the caller leaves within this time, also on a busy machine
            sleep(1.0)
        return square(slot, number)

    results = Pool(start, 1, tmp_path).each(tasks(), noting)
    process = next(results)[1][1]
    results.close()
    assert not alive(process)
    assert len(taken) <= 3
    with pytest.raises(Stopped):
        slots[0].child()


@pytest.mark.parametrize("where", ["tasks", "play"])
def test_an_error_reaches_the_caller(tmp_path: Path, where: str) -> None:
    """What the list of tasks or the function raises is raised where results are read."""

    def tasks():
        yield 1
        if where == "tasks":
            raise ZeroDivisionError(where)

    def play(slot, number):
        if where == "play":
            raise ZeroDivisionError(where)
        return [number]

    with pytest.raises(ZeroDivisionError, match=where):
        list(Pool(start, 2, tmp_path).each(tasks(), play))
