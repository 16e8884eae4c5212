"""Released versions of an engine, compared."""
