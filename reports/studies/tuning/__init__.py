"""Search of an engine's settings for tolerances."""
