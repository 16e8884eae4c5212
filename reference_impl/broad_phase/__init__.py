"""Pairs of pieces whose bounding boxes meet, and detection at one instant."""
