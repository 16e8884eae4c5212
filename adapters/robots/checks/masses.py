"""Mass, centre and inertia of each link beside those of a uniform solid of its shapes."""

from collections.abc import Iterator

import numpy as np

from touchstone.adapters.robots.checks.finding import Finding
from touchstone.adapters.robots.checks.posture import Posture, colliding, name_of
from touchstone.adapters.robots.links import MassProperties, body_mass, combined
from touchstone.adapters.robots.pieces import TYPE
from touchstone.adapters.robots.source import Source
from touchstone.scenarios.avatar.kinematics import piece_box
from touchstone.scenarios.files.mass_properties import uniform, volume
from touchstone.scenarios.plausibility import DENSITIES, UNITS
from touchstone.scenarios.scenario import Piece

MOMENTS = 5.0
"""Factor between a link's moments and those of a uniform solid of its shapes [1]: a thin shell has 1.7."""
OUTSIDE = 0.1
"""Distance of the centre of mass from the box about a link's shapes, relative to its size [1]: motors
are often drawn and do not collide."""


def masses(source: Source, posture: Posture) -> Iterator[Finding]:
    """Links whose mass, centre or inertia does not fit their shapes, in one posture; roots, too, that the
    model fixes to the world, unless they become fixed bodies: trees of MJCF without a joint."""
    model = source.model
    rigid = np.where(model.body_weldid == 0, model.body_rootid, model.body_weldid)
    trees = model.body_rootid[model.jnt_bodyid] if source.form == "mjcf" else model.body_rootid
    for link in sorted({*rigid[np.isin(model.body_rootid, trees)].tolist()} - {0}):
        own = np.flatnonzero(rigid == link).tolist()
        geoms = [geom for geom in colliding(model) if model.geom_bodyid[geom] in own]
        pieces = tuple(posture.piece(geom) for geom in geoms if TYPE[int(model.geom_type[geom])] != "plane")
        whole = combined(
            [
                body_mass(model, body).moved(posture.data.xpos[body], posture.data.xmat[body].reshape(3, 3))
                for body in own
            ]
        )
        if pieces and whole.mass > 0:
            yield from _link(name_of(model, "body", link), whole, pieces)


def _link(name: str, whole: MassProperties, pieces: tuple[Piece, ...]) -> Iterator[Finding]:
    try:
        _, solid = uniform(pieces, whole.mass)
    except ValueError:
        return
    density = whole.mass / sum(volume(piece.shape) for piece in pieces)
    if not DENSITIES[0] <= density <= DENSITIES[1]:
        yield Finding(
            "inertia",
            name,
            f"{whole.mass:.3g} kg in its shapes are {density:.3g} kg/m^3",
            UNITS,
        )
    boxes = np.array([piece_box(piece, np.zeros(3), np.eye(3)) for piece in pieces])
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    outside = float(np.linalg.norm(np.maximum(0.0, np.maximum(low - whole.center, whole.center - high))))
    if outside > OUTSIDE * float(np.linalg.norm(high - low)):
        yield Finding(
            "inertia",
            name,
            f"its centre of mass is {outside * 1e3:.3g} mm outside its shapes",
            "check <origin> of <inertial>, or pos of inertial: it is in the link's frame",
        )
    moments, uniform_moments = (np.linalg.eigvalsh(np.array(one)) for one in (whole.inertia, solid))
    ratios = moments / uniform_moments
    if ratios.max() > MOMENTS or ratios.min() < 1 / MOMENTS:
        span = " to ".join(dict.fromkeys(f"{ratio:.2g}" for ratio in (ratios.min(), ratios.max())))
        fitting = ", ".join(f"{moment:.3g}" for moment in uniform_moments)
        yield Finding(
            "inertia",
            name,
            f"its moments are {span} times those of a uniform solid of its shapes",
            f"such a solid of {whole.mass:.3g} kg has {fitting} kg m^2 about its axes",
        )
