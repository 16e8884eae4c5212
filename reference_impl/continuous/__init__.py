"""Motion within a substep, and the time of impact of moving pieces."""
