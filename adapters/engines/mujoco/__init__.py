"""Adapter of MuJoCo."""
