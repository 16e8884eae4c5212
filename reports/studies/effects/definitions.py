"""Names shared by the study, its table and its picture."""

from __future__ import annotations

from touchstone.scenarios.effects import EFFECT_TABLE

GROUPS = ("gallery", "probe")
"""Tags of the default scenes; means are computed per tag."""
REFERENCE, ALL = "reference", "all"
IDENTICAL, WITHIN, MATTERS = "identical", "within tolerance", "matters"
TOGGLED = tuple(name for name, effect in EFFECT_TABLE.items() if effect.only != "engines")
"""Effects that are toggled one at a time: those that the reference has."""
