"""Differences between two runs that count as none, per metric."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from math import isinf
from pathlib import Path
from typing import Annotated

from touchstone.scenarios.files.read import SceneFileError, data_of_file


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Largest difference of a metric's values, `absolute` [unit of the metric] plus `relative` times the
    larger value; patterns such as `time.*` for metric, engine and scenario. The last that fits holds."""

    metric: str
    relative: float = 0.0
    absolute: float = 0.0
    engine: str = "*"
    scenario: str = "*"

    def fits(self, metric: str, engine: str, scenario: str) -> bool:
        """Whether it holds for a row."""
        asked = ((metric, self.metric), (engine, self.engine), (scenario, self.scenario))
        return all(fnmatchcase(name, pattern) for name, pattern in asked)

    def covers(self, a: float, b: float) -> bool:
        """Whether two values differ by no more."""
        return isinf(self.relative) or abs(b - a) <= self.absolute + self.relative * max(abs(a), abs(b))


FILE = Path(__file__).with_name("times.toml")
"""Tolerances of times as `measured_times.py` measures them."""
FIGURES = Tolerance("*", relative=1e-6, absolute=1e-9)
"""Of all figures but times: engines repeat them to the bit on one machine; others round otherwise."""


@cache
def default() -> tuple[Tolerance, ...]:
    """Tolerances unless a file says otherwise: FIGURES, then the measured ones of times."""
    return (FIGURES, *_of_file(FILE))


def tolerances(path: Path | None) -> tuple[Tolerance, ...]:
    """Default tolerances, then those of a TOML or JSON file: an array `tolerances` with the fields of
    `Tolerance`.

    Raises:
        SceneFileError: the file is not valid; one line per fault.
    """
    return default() if path is None else (*default(), *_of_file(path))


def _of_file(path: Path) -> tuple[Tolerance, ...]:
    from pydantic import Field, Strict, create_model

    number = Annotated[float, Strict(), Field(ge=0)]
    forbid = {"extra": "forbid"}
    patterns = dict.fromkeys(("engine", "scenario"), (str, "*"))
    sizes = dict.fromkeys(("relative", "absolute"), (number, 0.0))
    one = create_model("Tolerance", __config__=forbid, metric=(str, ...), **sizes, **patterns)  # type: ignore
    model = create_model("Tolerances", __config__=forbid, tolerances=(tuple[one, ...], ...))  # type: ignore
    data, faults, message_of = data_of_file(path, model)
    if faults:
        raise SceneFileError(message_of(faults))
    return tuple(Tolerance(**entry) for entry in data["tolerances"])


def tolerance_of(all_of_them: tuple[Tolerance, ...], metric: str, engine: str, scenario: str) -> Tolerance:
    """The last tolerance that fits a row."""
    return next(one for one in reversed(all_of_them) if one.fits(metric, engine, scenario))
