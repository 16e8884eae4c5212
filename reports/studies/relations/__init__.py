"""Study `relations`."""
