"""Body of a scene from a link: its pieces and its mass."""

import numpy as np

from touchstone.adapters.robots.driven import named_once
from touchstone.adapters.robots.links import LEAST_MASS, Link, MassProperties, combined
from touchstone.adapters.robots.pieces import PieceMaker, geoms_of
from touchstone.adapters.robots.robot_error import RobotError
from touchstone.scenarios.scenario import Body, vector

BASE = MassProperties(1.0, np.zeros(3), 0.4 * 0.1**2 * np.eye(3))
"""Ball of 1 kg and 10 cm for a base that has no mass in the model."""
BASE_NOTE = "has no mass; as the root it gets"
LEAST_MOMENT = 1e-24
"""Moment of inertia [kg m^2] up to which a link counts as massless."""


def body_of(link: Link, maker: PieceMaker, notes: list[str], is_root: bool) -> Body:
    """Driven body of a link in the frame of its joint.

    Raises:
        RobotError: a link without mass or inertia that is not the root.
    """
    pieces = [
        maker.piece(geom, member.place, member.turn)
        for member in link.members
        for geom in geoms_of(maker.model, member.body)
    ]
    whole = link.mass
    if whole.mass <= LEAST_MASS or np.linalg.eigvalsh(whole.inertia)[0] <= LEAST_MOMENT:
        if not is_root:
            raise RobotError(f"body {link.name!r}: has no mass or no inertia, but a joint")
        notes.append(f"body {link.name!r}: {BASE_NOTE} {BASE.mass:g} kg")
        whole = link.mass = combined([whole, BASE])
    one, two, three = (vector(row) for row in whole.inertia)
    return Body(
        link.name, "driven", "robot", named_once(pieces), whole.mass, vector(whole.center), (one, two, three)
    )
