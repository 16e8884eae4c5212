"""Study `agreement`."""
