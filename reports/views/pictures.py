"""Colours and markers of pictures."""

from __future__ import annotations

from touchstone.adapters.registry import ENGINES

INK, PALE = "#222222", "#8a8a8a"
LIBRARY_COLORS = {"python-fcl": "#D55E00", "coal": "#0072B2"}
"""Colours of detectors that belong to no engine; with those of the engines, the palette of Okabe and Ito."""
MARKERS = "osD"
"""Markers of an engine's detectors, in the order of the table."""


def color_of(engine: str) -> str:
    """Colour of an engine in pictures."""
    return ENGINES[engine].color


def marker_of(engine: str) -> str:
    """Marker of an engine in pictures."""
    return ENGINES[engine].marker


def detector_color(name: str) -> str:
    """Colour of a detector or a variant by the engine or library that its name starts with."""
    colors = LIBRARY_COLORS | {engine: entry.color for engine, entry in ENGINES.items()}
    return next((color for owner, color in colors.items() if name.startswith(owner)), INK)
