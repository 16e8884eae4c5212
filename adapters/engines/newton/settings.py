"""Settings of Newton that `--set` changes (`settings.csv`), named as the parameters of its solvers."""

from touchstone.adapters.engines.newton import ENTRY
from touchstone.adapters.knobs import table_of

SETTINGS = table_of(__file__, ENTRY.profiles)
