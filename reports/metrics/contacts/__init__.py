"""Metrics of contact: overlap, passages, friction, rest."""
