"""Truths that a scene states beside the motion of its bodies."""
