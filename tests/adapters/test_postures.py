"""Postures: where hinged links are, by closed form."""

import numpy as np
import pytest

from touchstone.scenarios.avatar.driven_poses import driven_pieces
from touchstone.scenarios.scenario import Body, Box, Joint, Piece, Tracker
from touchstone.scenarios.solids import sphere_inertia

ROUNDING = 1e-12
"""A few dozen operations on lengths of metres [m]."""


def test_a_bent_arm(lab) -> None:
    """Bend an upright arm by a right angle: its hand points along x of a palm that is turned about z."""
    box = (Piece("box", Box((0.1, 0.1, 0.1)), (0.0, 0.0, 1.0)),)
    inertia = sphere_inertia(1.0, 0.1)
    links = [Body(name, "driven", "wood", box, mass=1.0, inertia=inertia) for name in ("upper", "lower")]
    joint = Joint("elbow", "upper", "lower", (0.0, 0.0, 2.0), (0.0, 1.0, 0.0))
    quarter = (0.5**0.5, 0.0, 0.0, 0.5**0.5)
    tracker = Tracker(
        "upper", ("elbow",), (0.0, 1.0), ((1.0, 2.0, 3.0),) * 2, (quarter,) * 2, ((np.pi / 2,),) * 2
    )
    scenario = lab.scene(lab.ground(), *links, joints=(joint,), trackers=(tracker,))
    upper, lower = driven_pieces(scenario)
    assert upper.position == pytest.approx((1.0, 2.0, 4.0), abs=ROUNDING)
    # the elbow is 2 m up; a right angle about the turned y, which is -x, leads up to +y
    assert lower.position == pytest.approx((1.0, 3.0, 5.0), abs=ROUNDING)
