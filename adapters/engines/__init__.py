"""The engines, one folder each: the only place where an engine is imported."""
