"""Causes of documented failings that several engines share."""

from __future__ import annotations

NEWTON = (
    "Newton's restitution with a friction that sticks at an eccentric contact gains 18 % of the "
    "energy in closed form, 0.46 J, and nothing guards it"
)
TOGETHER = (
    "impacts are solved together: one ball into three leaves -1/2, 1/2, 1/2, 1/2, then these "
    "three into the last 1/4, 1/4, 1/4, 3/4"
)
COARSE_SERVO = (
    "servos of 40 rad/s gain energy in pressed limbs at 1/240 s, half as fast they do not: dart's"
    " corner_slide 1107 J and 2 mJ, wall_push 9.1, 6.0 and 2.5 J (dart, bullet, mujoco) and 33 mJ"
    " each, mujoco's arms_cross 122 and 2 mJ (11 and 1 mJ at 1/540 s)"
)
