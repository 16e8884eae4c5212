"""Table of MuJoCo's settings that `--set` changes (`settings.csv`); names are those of options, flags and
contacts."""

from touchstone.adapters.engines.mujoco import ENTRY
from touchstone.adapters.knobs import table_of

OF_CONTACTS = ("solref", "solimp", "solreffriction", "bounce")
"""Settings of contacts; the others are fields of mjOption and flags."""
FLAGS = {"speculative": "mjENBL_SPECULATIVE", "sleep": "mjENBL_SLEEP"}
"""Settings that are bits of mjOption.enableflags."""
SETTINGS = table_of(__file__, ENTRY.profiles)
