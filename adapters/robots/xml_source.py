"""XML of a robot, checked before MuJoCo reads it: elements with their lines, and the files that they name.

Entities are refused, not expanded. Every file must exist, and lie in the folder of the robot's file unless
the user allows others. A URDF's `package://` paths are looked up in the folders above it.
"""

from __future__ import annotations

import re
import xml.parsers.expat
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import nan
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

from touchstone.adapters.robots.robot_error import RobotError
from touchstone.scenarios.files.safe_paths import PathRefused, allowed, regular

SCHEME = re.compile(r"^(package|model|file)://")
MOST_BYTES = 50_000_000
"""Largest XML file that is read: robots have some hundred kB."""
LFS_POINTER = b"version https://git-lfs"
"""Start of a file that stands in for one of Git LFS."""
NOT_FETCHED = "a Git LFS pointer, not the file itself; fetch it by: git lfs pull"
DEEPEST = 200
"""Deepest nesting of elements."""


@dataclass(slots=True)
class Element:
    """XML element with its line and the file that it stands in."""

    tag: str
    attributes: dict[str, str]
    file: Path
    line: int
    children: list[Element] = field(default_factory=list)

    def walk(self) -> Iterator[Element]:
        yield self
        for child in self.children:
            yield from child.walk()

    def named(self, reason: str) -> str:
        """Message about this element."""
        name = self.attributes.get("name") or self.attributes.get("joint") or ""
        return f"{self.file}:{self.line}: {self.tag}{f' {name!r}' if name else ''}: {reason}"

    def text(self) -> str:
        """XML text of the element, each tag on its own line of the file, so that MuJoCo names the file's
        lines; texts between elements are left out, since robots have none."""
        parts: list[str] = []
        self._write(parts, 1)
        return "".join(parts)

    def _write(self, parts: list[str], line: int) -> int:
        """Append the element's text, which begins at `line` or later; returns the line of its end."""
        given = "".join(f" {key}={quoteattr(value)}" for key, value in self.attributes.items())
        parts.append("\n" * (self.line - line) + f"<{escape(self.tag)}{given}>")
        line = max(line, self.line)
        for child in self.children:
            line = child._write(parts, line)
        parts.append(f"</{escape(self.tag)}>")
        return line


def number(element: Element, name: str) -> float:
    """A number of an attribute; 0 where it is absent, NaN where MuJoCo will refuse it."""
    try:
        return float(element.attributes.get(name, "0"))
    except ValueError:
        return nan


def parsed(path: Path) -> Element:
    """Root element of an XML file.

    Raises:
        RobotError: the file cannot be read, is not XML, or declares entities.
    """
    try:
        text = regular(path).read_bytes()
    except OSError as error:
        raise RobotError(f"{path}: {error.strerror or error}") from error
    if len(text) > MOST_BYTES:
        raise RobotError(f"{path}: {len(text)} bytes, expected at most {MOST_BYTES}")
    if text.startswith(LFS_POINTER):
        raise RobotError(f"{path}: {NOT_FETCHED}")
    parser = xml.parsers.expat.ParserCreate()
    stack: list[Element] = []
    roots: list[Element] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, attributes, path, parser.CurrentLineNumber)
        if len(stack) >= DEEPEST:
            raise RobotError(element.named(f"nested deeper than {DEEPEST} elements"))
        (stack[-1].children if stack else roots).append(element)
        stack.append(element)

    def refuse(name: str | None, *_: object) -> int:
        raise RobotError(f"{path}:{parser.CurrentLineNumber}: entity {name!r}: entities are not expanded")

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda tag: stack.pop()
    parser.EntityDeclHandler = refuse
    parser.SkippedEntityHandler = refuse
    parser.ExternalEntityRefHandler = refuse
    try:
        parser.Parse(text, True)
    except xml.parsers.expat.ExpatError as error:
        reason = xml.parsers.expat.ErrorString(error.code)
        raise RobotError(f"{path}:{error.lineno}: not XML: {reason}") from error
    if macro := next(filter(_is_macro, roots[0].walk()), None):
        raise RobotError(macro.named(f"not expanded; do it before: xacro {path.name} > expanded.urdf"))
    return roots[0]


def _is_macro(element: Element) -> bool:
    return element.tag.startswith("xacro:") or "${" in "".join(element.attributes.values())


def found_file(element: Element, folder: Path, name: str, allow_paths: bool) -> Path:
    """Path of a file that an element names; raises RobotError if it is missing or not allowed."""
    bare = SCHEME.sub("", name)
    tries = [folder / bare]
    if name.startswith(("package://", "model://")):
        inner = bare.partition("/")[2]
        tries = [
            above / part for above in (folder, *folder.resolve().parents) for part in (bare, inner) if part
        ]
    path = next((path for path in tries if path.is_file()), None)
    if path is None:
        raise RobotError(element.named(f"file {name!r} is missing"))
    with open(path, "rb") as file:
        if file.read(len(LFS_POINTER)) == LFS_POINTER:
            raise RobotError(element.named(f"file {name!r}: {NOT_FETCHED}"))
    try:
        return allowed(folder, str(path.resolve()), allow_paths)
    except PathRefused as error:
        reason = f"file {name!r} lies outside the robot's folder; allow it by --allow-paths"
        raise RobotError(element.named(reason)) from error


def is_text_stl(path: Path) -> bool:
    """Whether an STL file is text: the size of a binary one follows from the number of its triangles."""
    if path.suffix.lower() != ".stl":
        return False
    with open(path, "rb") as file:
        head = file.read(84)
    count = int.from_bytes(head[80:], "little")
    return head.startswith(b"solid") and path.stat().st_size != 84 + 50 * count
