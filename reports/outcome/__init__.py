"""Outcome of a run in a hard scene, by independent oracles: ok, or how it failed."""
