"""Names and sizes shared by the study, its table and its picture."""

from __future__ import annotations

STUDY, METRIC, ERROR, CLOSED_FORM = "predictability", "predictability", "predictability.error", "closed form"
SIZES = (1e-9, 1e-6, 1e-3)
"""Sizes of the perturbations [m]."""
DRAWS = 4
"""Number of random directions per size."""
