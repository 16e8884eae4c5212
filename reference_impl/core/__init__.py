"""Compiler decorator, conventions, structured arrays and rotations that every stage uses."""
