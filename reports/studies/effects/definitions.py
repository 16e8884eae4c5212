"""Names that the study, its table and its picture share."""

from __future__ import annotations

from touchstone.scenarios.effects import PLANNED

GROUPS = ("gallery", "probe")
"""Tags of the scenes that are played unless some are named, and for which means are told apart."""
REFERENCE, ALL = "reference", "all"
IDENTICAL, WITHIN, MATTERS = "identical", "within tolerance", "matters"
TOGGLED = tuple(effect for effect in PLANNED if effect != "sleeping")
"""Effects toggled alone: the reference knows no sleeping."""
