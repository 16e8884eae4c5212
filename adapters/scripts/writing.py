"""Traces as Python text: statements that repeat with other numbers become a loop over these numbers."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from touchstone.adapters.contract import Array, Settings, Unsupported, World
from touchstone.adapters.scripts.script import WIDTH, filled, literal, wrapped
from touchstone.adapters.scripts.trace import Attribute, Made, Ref, Statement, Trace, is_plain, references
from touchstone.scenarios.scenario import Scenario

MOST_REPEATED = 40
"""Statements of a loop."""
HOLE = "\0"
UNPACKING = ("import base64", "import zlib", "", "import numpy as np")
"""Imports of a script with recorded commands."""


@dataclass(frozen=True, slots=True)
class Block:
    """`count` repetitions of `length` statements from `start` on."""

    start: int
    length: int
    count: int

    @property
    def saved(self) -> int:
        """Statements that a loop saves."""
        return (self.count - 1) * self.length


class Writer:
    """Text of the statements `order` of a trace.

    Args:
        aliases: the start of a path in the module -> what the script calls it.
        hidden: named arguments that are left out.
        kept: results that the script uses after these statements.
        before: statements of the script before these; what they make has names of its own.
        starts: functions with which a loop may begin; none: all.
    """

    def __init__(
        self,
        trace: Trace,
        order: Sequence[int],
        aliases: Mapping[str, str],
        hidden: Sequence[str] = (),
        kept: Sequence[Ref] = (),
        before: Sequence[int] = (),
        starts: Sequence[str] = (),
    ) -> None:
        self._all, self._aliases, self._hidden = trace.statements, aliases, hidden
        self._within: dict[Ref, Made] = {}
        self._order = self._inlined(trace, order)
        self._forms = {k: self._form(trace.statements[k]) for k in self._order}
        used = {one for _, leaves in self._forms.values() for _, one in leaves if isinstance(one, Ref)}
        used |= set(kept)
        self._names = {
            k: trace.statements[k].names
            if any(Ref(k, i) in used for i in range(len(trace.statements[k].names)))
            else ()
            for k in (*before, *self._order)
        }
        self._starts = starts
        self._made = Counter(name for names in self._names.values() for name in names)
        self._blocks = self._folded()
        self._place = {}
        region = 0
        for number, block in enumerate(self._blocks):
            if number and (block.count > 1 or self._blocks[number - 1].count > 1):
                region += 1
            for i in range(block.start, block.start + block.length * block.count):
                self._place[self._order[i]] = region, (i - block.start) // block.length
        self._number = self._numbered()
        self._listed: set[str] = set()
        for ref in kept:
            self.reference(ref, None)
        self.lines()  # finds out which results later blocks use

    def _inlined(self, trace: Trace, order: Sequence[int]) -> list[int]:
        """The statements without those that only read what the next one uses alone: it contains them."""
        uses = Counter(
            ref
            for k in order
            for one in (self._all[k].function, *(value for _, value in self._all[k].arguments))
            for ref in references(one)
        )
        found = []
        for k, after in zip(order, (*order[1:], None)):
            owner = self._all[after].function.owner if after is not None else None
            if owner == Ref(k) and uses[Ref(k)] == 1 and trace.is_read(self._all[k]):
                self._within[Ref(k)] = Made(self._all[k].function, self._all[k].arguments)
            else:
                found.append(k)
        return found

    def _form(self, statement: Statement) -> tuple[str, list[tuple[str, Any]]]:
        """Text of a statement with holes, and what fills them, each with a name for it."""
        leaves: list[tuple[str, Any]] = []
        return self._text_of(statement, leaves), leaves

    def _text_of(self, one: Statement | Made, leaves: list[tuple[str, Any]]) -> str:
        head = self._path(one.function, leaves)
        name = one.function.name
        if isinstance(one, Statement) and one.assigned:
            return f"{head} = {self._argument(name, one.arguments[0][1], leaves)}"
        parts = []
        for key, value in one.arguments:
            if key not in self._hidden:
                text = self._argument(key or _hint(name), value, leaves)
                parts.append(f"{key}={text}" if key else text)
        return f"{head}({', '.join(parts)})"

    def _path(self, function: Any, leaves: list[tuple[str, Any]]) -> str:
        if isinstance(function, Attribute):
            if function.owner is None:
                return self._aliases.get(function.name, function.name)
            return f"{self._path(function.owner, leaves)}.{function.name}"
        return self._argument("it", function, leaves)

    def _argument(self, name: str, value: Any, leaves: list[tuple[str, Any]]) -> str:
        value = self._within.get(value, value) if isinstance(value, Ref) else value
        if isinstance(value, Attribute):
            return self._path(value, leaves)
        if isinstance(value, Made):
            return self._text_of(value, leaves)
        if isinstance(value, (tuple, list)) and not is_plain(value):
            return "[" + ", ".join(self._argument(name, one, leaves) for one in value) + "]"
        leaves.append((name, value))
        return HOLE

    def _folded(self) -> list[Block]:
        """Statements in blocks that save most lines, from the first on."""
        forms = [(self._forms[k][0], self._names[k]) for k in self._order]
        blocks, i = [], 0
        while i < len(forms):
            best = self._longest(forms, i)
            later = range(i + 1, min(i + best.length, len(forms))) if best.count > 1 else ()
            if any(self._longest(forms, j).saved >= best.saved for j in later):
                best = Block(i, 1, 1)
            blocks.append(best)
            i += best.length * best.count
        return blocks

    def _longest(self, forms: Sequence[Any], i: int) -> Block:
        """The repetition from `i` on that saves most."""
        best = Block(i, 1, 1)
        may = not self._starts or self._all[self._order[i]].called in self._starts
        for length in range(1, (min(MOST_REPEATED, (len(forms) - i) // 2) if may else 0) + 1):
            count = 1
            while forms[i : i + length] == forms[
                i + count * length : i + (count + 1) * length
            ] and not self._uses_others(i, length, count):
                count += 1
            best = max(best, Block(i, length, count), key=lambda block: block.saved)
        return best

    def _uses_others(self, start: int, length: int, count: int) -> bool:
        """Whether the next repetition uses what an earlier one makes: a loop's numbers come first."""
        mine = self._order[start + count * length : start + (count + 1) * length]
        others = set(self._order[start : start + count * length])
        leaves = (one for k in mine for _, one in self._forms[k][1])
        return any(isinstance(one, Ref) and one.statement in others for one in leaves)

    def _numbered(self) -> dict[Ref, int]:
        """Which of the results of its name each result is."""
        counts: Counter[str] = Counter()
        found = {}
        for k in self._order:
            for item, name in enumerate(self._names[k]):
                found[Ref(k, item)] = counts[name]
                counts[name] += 1
        return found

    def reference(self, ref: Ref, user: int | None) -> str:
        """Text for a result in the statement `user` (None: after all); its name, if it is made elsewhere."""
        name = self._all[ref.statement].names[ref.item]
        if self._made[name] == 1 or ref.statement not in self._place:
            return name
        if user is not None and self._place[user] == self._place[ref.statement]:
            latest = max(k for k in self._order if k < user and name in self._names[k])
            if latest == ref.statement and self._names[latest].count(name) == 1:
                return name
        self._listed.add(name)
        return f"{name}s[{self._number[ref]}]"

    def _leaf(self, value: Any, user: int) -> str:
        return self.reference(value, user) if isinstance(value, Ref) else literal(value)

    def lines(self, width: int = WIDTH) -> list[str]:
        """The statements; loops over rows of numbers of at most `width` characters a line."""
        found = [f"{name}s = []" for name in sorted(self._listed)]
        for block in self._blocks:
            rows = [
                [self._order[block.start + r * block.length + s] for s in range(block.length)]
                for r in range(block.count)
            ]
            found += self._loop(rows, width) if block.count > 1 else self._straight(rows[0], width)
        return found

    def _straight(self, statements: Sequence[int], width: int) -> list[str]:
        found = []
        for k in statements:
            leaves = [self._leaf(value, k) for _, value in self._forms[k][1]]
            found += self._written(k, leaves, width)
        return found

    def _written(self, k: int, leaves: Sequence[str], width: int = WIDTH) -> list[str]:
        """A statement with its results and the lists that keep them."""
        text = self._forms[k][0]
        for leaf in leaves:
            text = text.replace(HOLE, leaf, 1)
        names = self._names[k]
        found = wrapped(f"{', '.join(names)} = {text}" if names else text, width)
        return found + [f"{name}s.append({name})" for name in names if name in self._listed]

    def _loop(self, rows: Sequence[Sequence[int]], width: int) -> list[str]:
        """Statements of every repetition, with variables for what differs."""
        columns: dict[tuple[str, ...], str] = {}
        body: list[str] = []
        for s, k in enumerate(rows[0]):
            leaves = []
            for j, (name, _) in enumerate(self._forms[k][1]):
                values = tuple(self._leaf(self._forms[row[s]][1][j][1], row[s]) for row in rows)
                if len(set(values)) == 1:
                    leaves.append(values[0])
                    continue
                if values not in columns:
                    taken = [*columns.values(), *(n for m in rows[0] for n in self._all[m].names)]
                    columns[values] = _free(name, taken)
                leaves.append(columns[values])
            body += self._written(k, leaves, width)
        body = [f"    {line}" for line in body]
        if not columns:
            return [f"for _ in range({len(rows)}):", *body]
        names, data = list(columns.values()), [", ".join(row) for row in zip(*columns)]
        if len(names) > 1:
            data = [f"({row})" for row in data]
        if len(", ".join(data)) + len(", ".join(names)) < WIDTH - 12:
            return [f"for {', '.join(names)} in [{', '.join(data)}]:", *body]
        return [f"for {', '.join(names)} in [", *filled(data, width), "]:", *body]


def _hint(function: str) -> str:
    stem = function.removeprefix("set").removeprefix("reset").removeprefix("change").removeprefix("create")
    return f"{stem[:1].lower()}{stem[1:]}" if stem else "value"


def _free(name: str, taken: Sequence[str]) -> str:
    found, k = name, 2
    while found in taken:
        found, k = f"{name}_{k}", k + 1
    return found


def driven_steps(trace: Trace, world: World, scenario: Scenario, settings: Settings) -> list[range]:
    """Statements of each step of a world that plays a scene's driven bodies; none without any."""
    found = []
    for step in range(round(scenario.duration / settings.dt) if scenario.trackers else 0):
        start = len(trace.statements)
        world.drive(step)
        found.append(range(start, len(trace.statements)))
        world.step()
    return found


def commanded(trace: Trace, steps: Sequence[Sequence[int]], writer: Writer) -> tuple[Array | None, list[str]]:
    """Numbers of the statements of all steps (s, n), and the lines that take them from `row`.

    Raises:
        Unsupported: steps differ in more than numbers.
    """
    if not any(steps):
        return None, []
    forms = [[writer._form(trace.statements[k]) for k in step] for step in steps]
    if len({tuple(text for text, _ in form) for form in forms}) > 1:
        raise Unsupported("the commands of the driven bodies differ from step to step in more than numbers")
    numbers: list[Array] = []
    lines, first = [], 0
    for s in range(len(steps[0])):
        text = forms[0][s][0]
        for j, (_, value) in enumerate(forms[0][s][1]):
            every = [form[s][1][j][1] for form in forms]
            if isinstance(value, Ref):
                texts = {writer.reference(one, None) for one in every}
            else:
                texts = {literal(one) for one in every}
            if len(texts) == 1:
                text = text.replace(HOLE, texts.pop(), 1)
                continue
            column = np.array(every, dtype=float).reshape(len(every), -1)
            last = first + column.shape[1]
            whole = np.ndim(value) == 0
            text = text.replace(HOLE, f"float(row[{first}])" if whole else f"row[{first}:{last}].tolist()", 1)
            numbers.append(column)
            first = last
        lines += wrapped(text)
    return np.concatenate(numbers, axis=1) if numbers else np.zeros((len(steps), 1)), lines
