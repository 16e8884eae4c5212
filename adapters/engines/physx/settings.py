"""Table of PhysX's settings that `--set` changes (`settings.csv`), named as in SAPIEN."""

from touchstone.adapters.engines.physx import ENTRY
from touchstone.adapters.knobs import table_of

SETTINGS = table_of(__file__, ENTRY.profiles)
