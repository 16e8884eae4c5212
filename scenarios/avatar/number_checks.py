"""Checks of a scenario's numbers, which are finite, positive or of unit length, and of names in it."""

from collections.abc import Callable, Collection, Iterable
from math import isfinite

import numpy as np

from touchstone.scenarios.plural import plural

Report = Callable[[str, str], None]
"""Takes the path of a field and what is wrong with it."""
LONGEST = 1e15
"""Magnitude of lengths and coordinates of a scene [m]: beyond it, sums lose all digits of a metre."""
SHORTEST = 1e-15
"""Least size of a shape [m]: beside a metre it is rounding."""
LARGEST, SMALLEST = 1e30, 1e-30
"""Magnitude of any number of a scene, and least positive one [SI]: products of three keep all digits."""
UNIT_TOLERANCE = 1e-9
"""Tolerance of the length of a unit quaternion or axis [1]: rounding."""


def number_of(text: str) -> float:
    """Number of a user's text; raises ValueError for Arabic digits, 1_0 and the like."""
    if not text.isascii() or "_" in text:
        raise ValueError(f"found {text!r}, expected a number")
    return float(text)


def finite(
    values: Iterable[float], path: str, report: Report, width: int | None = None, most: float = LARGEST
) -> bool:
    """Report numbers that are not finite, larger than `most`, or not `width` many; whether there are none."""
    numbers = list(values)
    if width is not None and len(numbers) != width:
        report(path, f"found {plural(len(numbers), 'number')}, expected {width}")
        return False
    for value in numbers:
        if not isinstance(value, (int, float, np.number)) or not isfinite(value):
            report(path, f"found {value!r}, expected finite numbers")
            return False
        if abs(value) > most:
            report(path, f"found {value:g}, expected a magnitude of at most {most:g}")
            return False
    return True


def finite_rows(
    rows: Iterable[Iterable[float]], path: str, report: Report, width: int, most: float = LARGEST
) -> bool:
    """Report rows of numbers that are not finite, or not `width` long; whether there are none."""
    bad = [k for k, row in enumerate(rows) if not finite(row, f"{path}[{k}]", report, width, most)]
    return not bad


def positive(
    values: Iterable[float],
    path: str,
    report: Report,
    width: int | None = None,
    most: float = LARGEST,
    least: float = SMALLEST,
) -> bool:
    """Report numbers that are not positive, or beyond `least` and `most`; whether there are none."""
    numbers = list(values)
    if not finite(numbers, path, report, width, most):
        return False
    if min(numbers) < least:
        expected = f"numbers of at least {least:g}" if min(numbers) > 0 else "positive numbers"
        report(path, f"found {min(numbers)}, expected {expected}")
    return min(numbers) >= least


def sizes(values: Iterable[float], path: str, report: Report, width: int | None = None) -> bool:
    """Report sizes of a shape [m] that are not positive, or that no scene has; whether there are none."""
    return positive(values, path, report, width, LONGEST, SHORTEST)


def unit(values: tuple[float, ...], path: str, report: Report, width: int) -> bool:
    """Report a vector that is not of unit length; whether it is."""
    if not finite(values, path, report, width):
        return False
    if abs(sum(v * v for v in values) - 1) > UNIT_TOLERANCE:
        length = sum(v * v for v in values) ** 0.5
        such = f", such as [{', '.join(f'{v / length:.12g}' for v in values)}]" if length > 0 else ""
        report(path, f"found length {length:.12g}, expected 1{such}")
        return False
    return True


def known(kind: str, name: str, valid: Collection[str], path: str, report: Report) -> bool:
    """Report a name that is not valid; whether it is."""
    if name not in valid:
        report(path, f"unknown {kind} {name!r}; valid: {', '.join(valid)}")
    return name in valid
