"""Study `convergence`."""
