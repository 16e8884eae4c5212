"""Scenario in, Recording out. One file per engine; the only place an engine is imported."""
