"""The study `run`: request, simulation, measures, comparisons and results."""
