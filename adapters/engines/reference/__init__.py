"""Adapter of the reference implementation."""
