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
    "hinges that follow at 40 rad/s gain energy in pressed limbs at 1/240 s: dart's corner_slide 1.6 J, "
    "mujoco's 78 mJ; at the engines' own steps 0.5 and 0.9 mJ"
)
