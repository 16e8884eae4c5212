"""Names and sizes that the study, its table and its picture share."""

from __future__ import annotations

STUDY, METRIC, ERROR, CLOSED_FORM = "predictability", "predictability", "predictability.error", "closed form"
SIZES = (1e-9, 1e-6, 1e-3)
"""Of the perturbations [m]."""
DRAWS = 4
"""Directions per size."""
