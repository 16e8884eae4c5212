"""Study `narrow-phase`."""
