"""Verdicts: limits, known failings and their causes as data, and the judge."""
