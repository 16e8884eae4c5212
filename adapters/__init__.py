"""Adapters that turn a Scenario into a Recording, one per engine; no other package imports an engine."""
