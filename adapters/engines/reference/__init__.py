"""The reference behind the engine contract."""
