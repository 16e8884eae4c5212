"""Study `robustness`."""
