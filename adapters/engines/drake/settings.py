"""Settings of Drake that `--set` changes (`settings.csv`), named as in MultibodyPlant, SceneGraphConfig and
SimulatorConfig."""

from touchstone.adapters.engines.drake import ENTRY
from touchstone.adapters.knobs import table_of

SETTINGS = table_of(__file__, ENTRY.profiles)
