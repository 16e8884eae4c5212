"""Vega draws charts in a child process, which its JavaScript engine ends where memory is short."""

from __future__ import annotations

import atexit
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import vl_convert

from touchstone.adapters.workers.process import PATIENCE, ChildProcess

RESOLUTION = 150
"""Pixels of a PNG in an inch, which has 72 points: sizes of charts are in points."""
TRIES = 2
"""Processes in a row that end at their first chart, after which no other is started [1]."""


class RendererError(Exception):
    """A chart was not drawn; the message says why."""


class Vega:
    """The child's end. Commands: `svg` and `png`, of a Vega-Lite specification as JSON."""

    def handle(self, command: str, text: str) -> str | bytes:
        """The text of an SVG, or the bytes of a PNG."""
        chart = json.loads(text)
        if command == "svg":
            return str(vl_convert.vegalite_to_svg(chart))
        return bytes(vl_convert.vegalite_to_png(chart, ppi=RESOLUTION))


class _Renderer:
    """The parent's end: a process that is started for the first chart, and replaced where it ended."""

    def __init__(self) -> None:
        self._child: ChildProcess | None = None
        self._drawn = self._failed = 0
        self._reason = ""
        self.owner = os.getpid()

    def ask(self, command: str, chart: Mapping[str, Any]) -> Any:
        if self._failed == TRIES:
            raise RendererError(self._reason)
        if self._child is None:
            self._child, self._drawn = ChildProcess(Vega, (), Path(os.devnull), PATIENCE), 0
        try:
            found = self._child.ask(command, json.dumps(chart))
        except BaseException:  # Ctrl-C: its answer would be that of the next chart
            self.stop()
            raise
        if self._child.failure is None:
            self._drawn, self._failed = self._drawn + 1, 0
            return found
        self._failed = 0 if self._drawn else self._failed + 1
        self._reason = f"the process that draws {self._child.failure[1]}"
        self._child = None
        raise RendererError(self._reason)

    def stop(self) -> None:
        if self._child is not None:
            self._child.stop()
        self._child = None


_renderers: list[_Renderer] = []


def _renderer() -> _Renderer:
    """That of this process: a forked one has its own."""
    if not _renderers or _renderers[-1].owner != os.getpid():
        _renderers[:] = [_Renderer()]
        atexit.register(_renderers[0].stop)
    return _renderers[0]


def svg(chart: Mapping[str, Any]) -> str:
    """A Vega-Lite specification as SVG; raises RendererError."""
    return str(_renderer().ask("svg", chart))


def png(chart: Mapping[str, Any]) -> bytes:
    """A Vega-Lite specification as PNG; raises RendererError."""
    return bytes(_renderer().ask("png", chart))
