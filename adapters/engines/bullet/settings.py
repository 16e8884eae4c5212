"""Settings of Bullet that `--set` changes (`settings.csv`): pybullet's names, `coordinates` and `sleep`."""

from touchstone.adapters.engines.bullet import ENTRY
from touchstone.adapters.knobs import table_of

OF_BODIES = ("contactProcessingThreshold", "collisionMargin", "frictionAnchor", "coordinates", "sleep")
"""Settings of bodies; the others are arguments of setPhysicsEngineParameter."""
SETTINGS = table_of(__file__, ENTRY.profiles)
