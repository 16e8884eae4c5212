"""Recordings in formats of other programs."""
