"""What is wrong with a robot's file."""

from __future__ import annotations


class RobotError(ValueError):
    """A file holds no robot that a scene can represent; the message has a line per fault: file, line,
    element, reason."""
