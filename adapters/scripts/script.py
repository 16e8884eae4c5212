"""A script in an engine's own API that plays a scene as its adapter does, and lines that set its settings.

Each engine writes `Parts` (`script.py` beside its adapter); the text is the same for all engines. Lines of
settings are taken from what the adapter has set: a line to paste does what the recording shows.
"""

import ast
import base64
import textwrap
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from touchstone.adapters.contract import Array, Settings, Unsupported
from touchstone.adapters.recorder import substeps
from touchstone.scenarios.avatar.kinematics import matrix
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.scenario import UNMOVED, Scenario

MOST_LINES = 60
"""Lines of a script."""
MOST_COMMANDS = 2**19
"""Largest text of the recorded commands of driven bodies [characters]."""
WIDTH, UNLIMITED = 110, 10**9
"""Width of lines, and that of rows of numbers where a script has too many lines [characters]."""
MOMENTS = 10
"""Times that a script prints."""


@dataclass(frozen=True, slots=True)
class Parts:
    """What an engine writes for a scene.

    Attributes:
        requirement: what pip installs.
        imports: statements.
        settings: lines that set the engine's settings.
        scene: lines that build all else, for a width of lines [characters].
        step: lines that advance by one native step; `row` is that of `commands`.
        bodies: name of a moving body -> expression of it in the script.
        position: expression of the position of `body`; what is printed.
        read: lines before positions are read.
        commands: numbers of all steps (s, n) for driven bodies; None without any.
        of_mass: whether `position` is the centre of mass instead of the body's origin.
        start: lines before the first step; they may use `commands`.
    """

    requirement: str
    imports: Sequence[str]
    settings: Sequence[str]
    scene: Callable[[int], Sequence[str]]
    step: Sequence[str]
    bodies: Mapping[str, str]
    position: str
    read: Sequence[str] = ()
    commands: Array | None = None
    of_mass: bool = False
    start: Sequence[str] = ()


def moments(scenario: Scenario) -> list[int]:
    """Displayed frames at which a script prints positions, the last one included."""
    return sorted({round(k) for k in np.linspace(0, scenario.frame_count, MOMENTS + 1)[1:]})


def moving(scenario: Scenario) -> list[int]:
    """Indices of the bodies that a script prints."""
    return [k for k, body in enumerate(scenario.bodies) if body.kind not in UNMOVED]


def text_of(parts: Parts, scenario: Scenario, settings: Settings, head: Sequence[str]) -> str:
    """The script.

    Args:
        head: lines of its docstring.
    Raises:
        Unsupported: it would have more than MOST_LINES lines.
    """
    for width in (WIDTH, 3 * WIDTH, UNLIMITED):
        lines = _lines(parts, scenario, settings, head, width)
        lines = lines if width < UNLIMITED else joined(lines)
        if len(lines) <= MOST_LINES:
            return "\n".join(lines) + "\n"
    raise Unsupported(
        f"a script of {scenario.name} would have {len(lines)} lines, more than {MOST_LINES}: "
        "its bodies differ"
    )


def joined(lines: Sequence[str]) -> list[str]:
    """Lines with neighbouring simple statements on one line, up to WIDTH characters."""
    found: list[str] = []
    for line in lines:
        both = f"{found[-1]}; {line.strip()}" if found else ""
        fits = bool(found) and len(both) <= WIDTH and _indent(line) == _indent(found[-1])
        if fits and _is_simple(line) and _is_simple(found[-1]):
            found[-1] = both
        else:
            found.append(line)
    return found


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())


def _is_simple(line: str) -> bool:
    """Whether a line is complete and could share its line with another."""
    try:
        body = ast.parse(line.strip()).body
    except SyntaxError:
        return False
    return bool(body) and all(isinstance(one, (ast.Expr, ast.Assign)) for one in body) and "#" not in line


def _lines(
    parts: Parts, scenario: Scenario, settings: Settings, head: Sequence[str], width: int
) -> list[str]:
    rate, frames, each = scenario.frame_rate, scenario.frame_count, substeps(scenario, settings.dt)
    names = ", ".join(f"{name!r}: {one}" for name, one in parts.bodies.items())
    head = [within(one) for one in head]
    driven = parts.commands is not None
    commands = [f"commands = {packed(parts.commands)}"] if parts.commands is not None else []
    off = [
        f"            if frame == {frames} and name in truth:",
        "                off = sum((a - b) ** 2 for a, b in zip((x, y, z), truth[name])) ** 0.5",
        '                print(f"  {name} is {off:.3g} m from the closed form")',
    ]
    return [
        *('"""' + head[0], *head[1:], '"""', "", *parts.imports, "", *parts.settings, *parts.scene(width)),
        *(
            *commands,
            *parts.start,
            f"bodies = {{{names}}}",
            f"shown = {moments(scenario)!r}  # of {rate} frames a second",
        ),
        *(*_truth(scenario, parts.of_mass), f"for frame in range(1, {frames + 1}):"),
        f"    for step in range({each} * (frame - 1), {each} * frame):  # {settings.dt:.9g} s each",
        *(f"        {line}" for line in (["row = commands[step]"] if driven else [])),
        *(f"        {line}" for line in parts.step),
        *("    if frame in shown:", *(f"        {line}" for line in parts.read)),
        *("        for name, body in bodies.items():", f"            x, y, z = {parts.position}"),
        f'            print(f"{{frame / {rate}:.4f}} {{x}} {{y}} {{z}} {{name}}")',
        *(off if _truths(scenario) else []),
    ]


def _truths(scenario: Scenario) -> list[int]:
    names = {truth.body for truth in scenario.truths}
    return [k for k in moving(scenario) if scenario.bodies[k].name in names]


def _truth(scenario: Scenario, of_mass: bool) -> list[str]:
    """Line with the positions of the closed form at the scene's end."""
    truths = {truth.body: truth for truth in scenario.truths}
    found = {}
    for k in _truths(scenario):
        body = scenario.bodies[k]
        end = motion(scenario, truths[body.name], np.array([scenario.frame_count / scenario.frame_rate]))
        arm = np.zeros(3) if of_mass else matrix(end.orientation[0]) @ body.center_of_mass
        found[body.name] = tuple((end.position[0] - arm).tolist())
    return [f"truth = {found!r}  # [m] closed form at the end"] if found else []


def packed(commands: Array) -> str:
    """Expression of numbers (s, n), to the bit: base64 of their compressed bytes.

    Raises:
        Unsupported: the text has more than MOST_COMMANDS characters.
    """
    data = base64.b64encode(zlib.compress(np.ascontiguousarray(commands).tobytes(), 9)).decode()
    if len(data) > MOST_COMMANDS:
        raise Unsupported(
            f"the recorded commands of driven bodies take {len(data)} characters, more than {MOST_COMMANDS}"
        )
    inner = f'zlib.decompress(base64.b64decode("{data}"))'
    return f"np.frombuffer({inner}).reshape({commands.shape[0]}, {commands.shape[1]})"


def literal(value: Any) -> str:
    """Python text of numbers, names and nested sequences, to the bit; what is not finite as float(...)."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, (tuple, list)):
        inner = ", ".join(map(literal, value))
        if isinstance(value, list):
            return f"[{inner}]"
        return f"({inner},)" if len(value) == 1 else f"({inner})"
    if isinstance(value, float) and not isfinite(value):
        return f'float("{value}")'
    if isinstance(value, int) and not isinstance(value, bool):
        return repr(int(value))
    return repr(value)


def within(text: str) -> str:
    """Text as it stands inside of three quotation marks."""
    return text.replace("\\", "\\\\").replace('"""', r"\"\"\"")


def filled(rows: Sequence[str], width: int) -> list[str]:
    """Rows of data on lines of at most `width` characters."""
    found: list[str] = []
    for row in rows:
        if found and len(found[-1]) + len(row) + 2 <= width:
            found[-1] += f" {row},"
        else:
            found.append(f"    {row},")
    return found


def wrapped(text: str, width: int = WIDTH) -> list[str]:
    """A statement with brackets as lines of at most `width` characters, where blanks allow it."""
    return textwrap.wrap(
        text, width, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False
    )
