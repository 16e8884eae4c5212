"""Robots of others: URDF and MJCF read through MuJoCo's MjSpec as scenes, and scenes written as both."""
