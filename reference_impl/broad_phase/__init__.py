"""Broad phase: pairs of pieces whose bounding boxes overlap, and collision detection at one instant."""
