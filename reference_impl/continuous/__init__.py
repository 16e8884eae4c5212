"""Motion of bodies within a substep, and the time of impact of their pieces."""
