"""All checks of a robot's file."""

from collections.abc import Iterator
from pathlib import Path

from touchstone.adapters.robots.checks.drives import drives
from touchstone.adapters.robots.checks.finding import NOTE, Finding
from touchstone.adapters.robots.checks.grip import grips
from touchstone.adapters.robots.checks.masses import masses
from touchstone.adapters.robots.checks.posture import postures
from touchstone.adapters.robots.checks.shapes import hulls, overlaps
from touchstone.adapters.robots.pieces import PieceMaker
from touchstone.adapters.robots.source import Source, compiled

CHECKS = ("motion", "hull", "overlap", "inertia", "limit", "drive", "grip")
"""Names of the checks, in order."""


def findings(path: Path, allow_paths: bool = False) -> Iterator[Finding]:
    """Findings about a URDF or MJCF file.

    Args:
        allow_paths: whether files outside the robot's folder may be read.
    Raises:
        RobotError: the file is not valid, or holds what no scene can represent; a line per fault.
    """
    source = compiled(path, allow_paths)
    maker = PieceMaker(source.model, [])
    places = postures(source.model, maker)
    yield from _motion(source)
    yield from hulls(source.model, maker)
    yield from overlaps(places)
    yield from masses(source, places[0])
    yield from drives(source, places)
    yield from grips(source, places[0])


def _motion(source: Source) -> Iterator[Finding]:
    """A note where no joint moves anything: the other checks are of what moves."""
    if not source.model.nv:
        text = "nothing moves: it has no joint, or fixed ones alone"
        remedy = "as a scene it is one free body" if source.form == "urdf" else "no scene can be made of it"
        yield Finding("motion", "robot", text, f"{remedy}; name what its joints are", NOTE)
