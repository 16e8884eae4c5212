"""Table of DART's settings that `--set` changes (`settings.csv`).

dartpy binds no setter of DART's contact error reduction (0.01, at most 1 mm/s); its only position correction
that can be chosen is `split_impulse`.
"""

from touchstone.adapters.engines.dart import ENTRY
from touchstone.adapters.knobs import table_of

SETTINGS = table_of(__file__, ENTRY.profiles)
