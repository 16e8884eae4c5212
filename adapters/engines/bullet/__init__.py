"""Adapter of Bullet through pybullet."""
