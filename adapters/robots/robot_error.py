"""What is wrong with a robot's file."""


class RobotError(ValueError):
    """A file holds no robot that a scene can represent; the message has a line per fault: file, line,
    element, reason."""
