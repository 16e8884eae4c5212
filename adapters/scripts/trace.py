"""A record of the calls that an adapter makes of an engine's Python module, to be written as a script.

`Trace.module` stands for the module: it passes every call on and records it with its arguments. Objects of
the engine are followed by proxies, numbers are kept as they are. What only reads is left out of the script
unless a later call uses its result.
"""

import re
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

PLAIN = (bool, int, float, str, bytes, type(None), np.ndarray, np.generic)
READS = re.compile(r"(get|is|are|has|num|sync)(?=[A-Z])")
"""Start of the names of functions that change nothing."""


@dataclass(frozen=True, slots=True)
class Ref:
    """Result of a statement; `item` of a tuple."""

    statement: int
    item: int = 0


@dataclass(frozen=True, slots=True)
class Attribute:
    """A function or a value of an object or a module; `owner` None: the module itself."""

    owner: Any
    name: str


@dataclass(frozen=True, slots=True)
class Made:
    """A value that a call makes, such as a pose; written where it is used."""

    function: Any
    arguments: tuple[tuple[str, Any], ...]


@dataclass(slots=True)
class Statement:
    """A call, or an assignment to an attribute (`assigned`), with its arguments ("" : by position).

    Attributes:
        results: number of results that later statements may use.
    """

    function: Any
    arguments: tuple[tuple[str, Any], ...]
    assigned: bool = False
    results: int = 0
    names: tuple[str, ...] = field(default_factory=tuple)

    @property
    def called(self) -> str:
        """Name of the function or attribute."""
        return str(self.function.name)


class Handle(int):
    """A number that an engine gives to an object, with the statement that made it."""

    ref: Ref


class Trace:
    """The statements of an adapter.

    Args:
        module: the engine's module.
        values: names of functions whose results are values (`Made`).
        handles: functions that return a number for what they make, with its name in a script.
        reads: further functions that change nothing.
    """

    def __init__(
        self,
        module: Any,
        values: Callable[[str], bool] = lambda name: False,
        handles: dict[str, str] | None = None,
        reads: Collection[str] = (),
    ) -> None:
        self.statements: list[Statement] = []
        self.module = Proxy(self, module, Attribute(None, module.__name__))
        self._values, self._handles, self._reads = values, handles or {}, frozenset(reads)
        self._latest: tuple[int, Ref] | None = None
        self._paused = False

    def helper(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """A function whose source is part of the script: recorded as one value, not by what it calls."""

        def call(*arguments: Any) -> Any:
            self._paused, before = True, self._paused
            try:
                real = unwrapped(function(*map(unwrapped, arguments)))
            finally:
                self._paused = before
            return Proxy(
                self, real, Made(Attribute(None, name), tuple(("", a) for a in map(expression, arguments)))
            )

        return call

    def called(self, owner: Any, function: Any, arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
        """Pass a call on and record it; returns what the adapter gets."""
        found = function(*map(unwrapped, arguments), **{k: unwrapped(v) for k, v in named.items()})
        texts = [("", expression(one)) for one in arguments] + [(k, expression(v)) for k, v in named.items()]
        if self._values(owner.name) and not self._paused:
            return Proxy(self, found, Made(owner, tuple(texts)))
        if self._paused:
            return found
        if self._latest and texts and texts[0] == ("", self._latest[0]):
            texts[0] = ("", self._latest[1])  # the adapter has made a plain number of the handle
        statement = Statement(owner, tuple(texts))
        self.statements.append(statement)
        place = len(self.statements) - 1
        if owner.name in self._handles:
            statement.results, statement.names = 1, (self._handles[owner.name],)
            handle = Handle(found)
            handle.ref = Ref(place)
            if owner.name == list(self._handles)[-1]:
                self._latest = int(found), handle.ref
            return handle
        return self._followed(statement, place, found)

    def _followed(self, statement: Statement, place: int, found: Any) -> Any:
        if is_plain(found):
            return found
        if isinstance(found, (tuple, list)):
            statement.results = len(found)
            statement.names = tuple(variable(type(one).__name__) for one in found)
            return type(found)(
                one if is_plain(one) else Proxy(self, one, Ref(place, k)) for k, one in enumerate(found)
            )
        statement.results, statement.names = 1, (variable(type(found).__name__),)
        return Proxy(self, found, Ref(place))

    def assigned(self, owner: Any, name: str, value: Any) -> None:
        self.statements.append(Statement(Attribute(owner, name), (("", expression(value)),), assigned=True))

    def is_read(self, statement: Statement) -> bool:
        """Whether a statement changes nothing."""
        return not statement.assigned and (
            bool(READS.match(statement.called)) or statement.called in self._reads
        )


class Proxy:
    """Stands for an object, a function or a module of an engine."""

    def __init__(self, trace: Trace, real: Any, expr: Any) -> None:
        object.__setattr__(self, "_trace", trace)
        object.__setattr__(self, "_real", real)
        object.__setattr__(self, "_expr", expr)

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._real, name)
        return found if is_plain(found) else Proxy(self._trace, found, Attribute(self._expr, name))

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._real, name, unwrapped(value))
        self._trace.assigned(self._expr, name, value)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self._trace.called(self._expr, self._real, arguments, named)

    def __eq__(self, other: object) -> bool:
        return bool(self._real == unwrapped(other))

    def __hash__(self) -> int:
        return hash(self._real)


def is_plain(value: Any) -> bool:
    """Whether a value consists of numbers and texts."""
    if isinstance(value, (tuple, list)):
        return all(map(is_plain, value))
    if isinstance(value, dict):
        return all(map(is_plain, value.values()))
    return isinstance(value, (*PLAIN, range)) and not isinstance(value, Handle)


def unwrapped(value: Any) -> Any:
    """The engine's own object."""
    if isinstance(value, Proxy):
        return value._real
    if isinstance(value, (tuple, list)) and not is_plain(value):
        return type(value)(map(unwrapped, value)) if type(value) in (tuple, list) else value
    return value


def expression(value: Any) -> Any:
    """What a script writes for an argument."""
    if isinstance(value, Proxy):
        return value._expr
    if isinstance(value, Handle):
        return value.ref
    if is_plain(value):
        return list(value) if isinstance(value, range) else value
    if isinstance(value, (tuple, list)):
        return type(value)(map(expression, value))
    # an object that was made before the trace began, such as a detector
    return Made(Attribute(Attribute(None, type(value).__module__), type(value).__name__), ())


def variable(name: str) -> str:
    """Name of a variable for a class: BodyNode -> body_node."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def references(value: Any) -> Iterator[Ref]:
    """Results that an expression uses."""
    if isinstance(value, Ref):
        yield value
    elif isinstance(value, Attribute):
        yield from references(value.owner)
    elif isinstance(value, Made):
        yield from references(value.function)
        for _, one in value.arguments:
            yield from references(one)
    elif isinstance(value, (tuple, list)):
        for one in value:
            yield from references(one)


def needed(trace: Trace, kept: Collection[Ref] = ()) -> list[int]:
    """Indices of the statements that a script needs: those that change something, what these use, and what
    made `kept`."""
    used, found = {ref.statement for ref in kept}, []
    for k in reversed(range(len(trace.statements))):
        statement = trace.statements[k]
        if k in used or not trace.is_read(statement):
            found.append(k)
            for value in (statement.function, *(one for _, one in statement.arguments)):
                used |= {ref.statement for ref in references(value)}
    return found[::-1]
