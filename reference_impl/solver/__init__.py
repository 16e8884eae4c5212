"""Contact solver: islands, contact rows, Gauss-Seidel sweeps and Newton's method."""
