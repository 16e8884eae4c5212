"""Kernels, conventions, records and rotations that every stage uses."""
