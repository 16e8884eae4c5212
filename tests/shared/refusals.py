"""What an engine refuses of the probes without driven bodies, in this process or in a child."""

from touchstone.adapters.contract import Settings, Unsupported
from touchstone.adapters.recorder import build
from touchstone.adapters.registry import profiles_of
from touchstone.scenarios.catalogue import tagged


def undriven():
    """Probes without driven bodies."""
    return [scene for scene in tagged("probe") if not scene.trackers]


def refused(engine, task):
    """Reasons by the name of the scene, under `task.profile`."""
    found, dt = {}, profiles_of(task.engine, task.profile)[task.profile]
    for scene in undriven():
        try:
            build(engine, scene, Settings(task.profile, dt))[0].close()
        except Unsupported as error:
            found[scene.name] = str(error)
    return found
