"""Adapter of DART 6 through dartpy."""
