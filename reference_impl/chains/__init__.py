"""Inverse kinematics of chains: cyclic coordinate descent and the posture QP."""
