"""Contact solver: mobility at contacts, islands, contact rows, sweeps, and methods of second order."""
