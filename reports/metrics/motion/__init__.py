"""Metrics of motion: energy, momentum, flight, events."""
