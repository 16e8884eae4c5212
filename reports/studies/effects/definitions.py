"""Names shared by the study, its table and its picture."""

from __future__ import annotations

from touchstone.scenarios.effects import PLANNED

GROUPS = ("gallery", "probe")
"""Tags of the default scenes; means are computed per tag."""
REFERENCE, ALL = "reference", "all"
IDENTICAL, WITHIN, MATTERS = "identical", "within tolerance", "matters"
TOGGLED = tuple(effect for effect in PLANNED if effect != "sleeping")
"""Effects that are toggled one at a time; the reference has no sleeping."""
