"""What an assertion found: a value, its limit, where in the run, and the line that shows it."""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Place:
    """Where in a run: frame, bodies by name, and what happened there."""

    frame: int | None = None
    bodies: tuple[str, ...] = ()
    remark: str = ""


@dataclass(frozen=True, slots=True)
class Finding:
    """A measured value [SI unit] of a metric, its limit, and where it was measured."""

    metric: str
    value: float
    unit: str
    limit: float
    reason: str  # of the limit
    source: str  # scene, engine, profile and step
    place: Place = Place()
    time: float | None = None  # [s] of the place
    shown_by: str = ""  # the line that shows it

    @property
    def met(self) -> bool:
        """Whether the value is within its limit; NaN is not."""
        return abs(self.value) <= self.limit

    @property
    def text(self) -> str:
        """What, by how much, which body, where in the run, and the line that shows it."""
        unit = f" {self.unit}" if self.unit != "1" else ""
        lines = [f"{self.metric} is {self.value:.4g}{unit}, limit {self.limit:.4g}{unit}: {self.source}"]
        where = []
        if self.place.bodies:
            where.append(" and ".join(self.place.bodies))
        if self.place.frame is not None:
            at = f" at {self.time:.4f} s" if self.time is not None else ""
            where.append(f"in frame {self.place.frame}{at}")
        if self.place.remark:
            where.append(self.place.remark)
        lines += [f"  where: {', '.join(where)}"] if where else []
        lines += [f"  limit: {self.reason}"] if self.reason else []
        lines += [f"  shown by: {self.shown_by}"] if self.shown_by else []
        return "\n".join(lines)


class InvariantError(AssertionError):
    """An invariant is broken, or could not be judged; `findings` has what was measured."""

    def __init__(self, message: str, findings: tuple[Finding, ...] = ()) -> None:
        self.findings = findings
        super().__init__(message)


LISTENER: ContextVar[Callable[[Finding], None] | None] = ContextVar("LISTENER", default=None)
"""Called with every finding; the pytest plug-in writes them as properties of the test."""


def settled(findings: tuple[Finding, ...]) -> float:
    """Tell the listener of findings; returns the first value, or raises InvariantError if a limit is
    broken."""
    listener = LISTENER.get()
    for finding in findings if listener else ():
        listener(finding)  # type: ignore[misc]
    broken = [finding for finding in findings if not finding.met]
    if broken:
        raise InvariantError("\n".join(finding.text for finding in broken), findings)
    return findings[0].value
