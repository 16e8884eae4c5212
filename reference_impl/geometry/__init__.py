"""Narrow phase of convex pieces: support functions, distance, penetration depth and contact manifolds."""
