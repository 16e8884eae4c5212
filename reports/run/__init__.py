"""The study `run`: what was asked for, play, measures, comparisons and results."""
