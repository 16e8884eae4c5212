"""Kinematics of driven bodies: poses and velocities of links, inertia, joint limits."""
