"""DART 6 through dartpy."""
