"""Bullet through pybullet."""
