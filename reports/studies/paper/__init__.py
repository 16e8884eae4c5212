"""Study `paper`."""
