"""Convex pieces: support functions, distance, penetration depth and contact manifolds."""
