"""What must hold in a hard scene, as plain data beside it: tolerances, walls, regions and the time of rest.

Lengths in m, speeds in m/s. The tolerances belong to a family and are the same for all engines.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from touchstone.scenarios.scenario import Body, Truth, Vector


@dataclass(frozen=True, slots=True)
class Wall:
    """Plane through `point` that the centres of bodies must not cross; they stay on the side of `normal`.

    `bodies` names them; empty: all simulated bodies.
    """

    point: Vector
    normal: Vector = (0.0, 0.0, 1.0)
    bodies: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Region:
    """Box, `low` to `high` [m], in which the origin of a body must be in the last frame."""

    body: str
    low: Vector
    high: Vector


@dataclass(frozen=True, slots=True)
class Checks:
    """Conditions of a run that is `ok`.

    Attributes:
        position: largest distance of a centre of mass from its closed form [m].
        overlap: largest depth of two bodies [m], beyond the depth at which the scene starts them.
        parted_by: time from which the initial overlap must be gone as well [s]; inf: it may remain.
        energy: largest rise of the mechanical energy over that which is available [1]; inf: not checked.
        energy_loss: largest loss of it over the same [1], for scenes that conserve it; inf: not checked.
        momentum: largest change of linear and angular momentum over their sums [1], for isolated scenes.
        speed: speed of a body beyond which the scene has exploded [m/s]; inf: by energy only.
        tracked: largest distance of a link from its tracked place in the last frame [m]; inf: not checked.
        rest_from: time from which simulated bodies must be at rest [s]; inf: never.
        creep: largest displacement of a body over that time, at the pace of its second half [m]; in the first
            it may also settle by `overlap`.
        jitter: largest root mean square speed of a body's surface from then on [m/s].
        walls: planes that no centre may cross.
        regions: where bodies must be in the last frame.
    """

    position: float = 5e-3
    overlap: float = 5e-3
    parted_by: float = 0.0
    energy: float = 0.05
    energy_loss: float = float("inf")
    momentum: float = 1e-3
    speed: float = float("inf")
    tracked: float = float("inf")
    rest_from: float = float("inf")
    creep: float = 1e-3
    jitter: float = 1e-2
    walls: tuple[Wall, ...] = ()
    regions: tuple[Region, ...] = ()


@dataclass(frozen=True, slots=True)
class Case:
    """Scene of a family at one level, without its name; `fields` are further fields of the scenario."""

    summary: str
    bodies: tuple[Body, ...]
    checks: Checks
    duration: float = 1.0
    restitution: float = 0.0
    friction: float = 0.5
    truths: tuple[Truth, ...] = ()
    tags: tuple[str, ...] = ()
    fields: Mapping[str, object] = field(default_factory=dict)
