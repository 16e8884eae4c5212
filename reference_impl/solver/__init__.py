"""The contact solver: islands, rows, sweeps and Newton's method."""
