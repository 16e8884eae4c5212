"""Line numbers of the values in a TOML or JSON text that its parser has accepted."""

import json
import re

Path = tuple[str | int, ...]
"""Keys and indices from the root of a document to a value."""

TOKEN = re.compile(
    r"""(?P<skip>[ \t\r]+|\#[^\n]*)|(?P<newline>\n)
    |(?P<text>\"{3}(?:\\.|[^\\])*?\"{3,5}|'{3}.*?'{3,5}|"(?:\\.|[^"\\\n])*"|'[^'\n]*')
    |(?P<mark>[\[\]{},=.:])|(?P<bare>[^\s\[\]{},=.:\#"']+)""",
    re.VERBOSE | re.DOTALL,
)
END = ("", "", 0)


class _Lines:
    """Reader of tokens (kind, text, line) that notes the line of every path."""

    def __init__(self, text: str) -> None:
        self.found: dict[Path, int] = {(): 1}
        self._tokens, line = [], 1
        for match in TOKEN.finditer(text):
            if match.lastgroup != "skip":
                self._tokens.append((str(match.lastgroup), match.group(), line))
            line += match.group().count("\n")
        self._next = 0

    def peek(self) -> tuple[str, str, int]:
        return self._tokens[self._next] if self._next < len(self._tokens) else END

    def take(self) -> tuple[str, str, int]:
        token = self.peek()
        self._next += 1
        return token

    def skip_newlines(self) -> None:
        while self.peek()[0] == "newline":
            self._next += 1

    def note(self, path: Path, line: int) -> None:
        self.found.setdefault(path, line)

    def key(self, path: Path) -> Path:
        """A key, or several with dots between them, each noted."""
        while True:
            _, text, line = self.take()
            path = (*path, _plain(text))
            self.note(path, line)
            if self.peek()[1] != ".":
                return path
            self.take()

    def value(self, path: Path) -> None:
        self.skip_newlines()
        kind, text, line = self.take()
        self.note(path, line)
        if kind == "mark" and text == "[":
            self._array(path)
        elif kind == "mark" and text == "{":
            self._table(path)
        else:  # a scalar: dates and numbers consist of several tokens
            while (token := self.peek()) != END and token[0] != "newline" and token[1] not in (",", "]", "}"):
                self.take()

    def _array(self, path: Path) -> None:
        index = 0
        while True:
            self.skip_newlines()
            if self.peek()[1] in ("]", ""):
                self.take()
                return
            self.value((*path, index))
            index += 1
            self.skip_newlines()
            if self.peek()[1] == ",":
                self.take()

    def _table(self, path: Path) -> None:
        while True:
            self.skip_newlines()
            if self.peek()[1] in ("}", ""):
                self.take()
                return
            key = self.key(path)
            self.skip_newlines()
            self.take()  # = or :
            self.value(key)
            self.skip_newlines()
            if self.peek()[1] == ",":
                self.take()


def _plain(text: str) -> str:
    """A key without its quotes."""
    if text[:1] == '"':
        return str(json.loads(text))
    return text.strip("'")


def json_lines(text: str) -> dict[Path, int]:
    """Line of every value of a JSON document, by path."""
    reader = _Lines(text)
    reader.value(())
    return reader.found


def toml_lines(text: str) -> dict[Path, int]:
    """Line of every value of a TOML document, by path."""
    reader = _Lines(text)
    counts: dict[Path, int] = {}
    place: Path = ()
    while reader.peek() != END:
        kind, mark, line = reader.peek()
        if kind == "newline":
            reader.take()
        elif mark == "[":
            reader.take()
            several = reader.peek()[1] == "["
            if several:
                reader.take()
            keys: Path = ()
            while True:
                keys = (*keys, _plain(reader.take()[1]))
                if reader.take()[1] != ".":
                    break
            if several:
                reader.take()
            place = _place(keys, counts, several)
            for end in range(1, len(place) + 1):
                reader.note(place[:end], line)
        else:
            key = reader.key(place)
            reader.take()
            reader.value(key)
    return reader.found


def _place(keys: Path, counts: dict[Path, int], several: bool) -> Path:
    """Path of a table from its header: each array of tables on the way stands at its last element."""
    place: Path = ()
    for k, key in enumerate(keys):
        place = (*place, key)
        if several and k == len(keys) - 1:
            counts[place] = counts.get(place, -1) + 1
        if place in counts:
            place = (*place, counts[place])
    return place


def line_of(lines: dict[Path, int], path: Path) -> int:
    """Line of a path, or of the nearest value above it."""
    while path not in lines:
        path = path[:-1]
    return lines[path]
