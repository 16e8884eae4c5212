"""Table of Rapier's settings that `--set` changes (`settings.csv`), named as in IntegrationParameters and
RigidBodyBuilder."""

from touchstone.adapters.engines.rapier import ENTRY
from touchstone.adapters.knobs import table_of

SETTINGS = table_of(__file__, ENTRY.profiles)
