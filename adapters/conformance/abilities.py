"""What engines can represent: per ability a scene of the catalogue, which an engine builds or refuses."""

from typing import NamedTuple

from touchstone.adapters.contract import DRIVES, Settings
from touchstone.adapters.registry import profiles_of


class Asked(NamedTuple):
    """A scene that needs an ability, and how it is played."""

    scene: str
    drive: str = DRIVES[0]
    effects: tuple[str, ...] | None = None

    def settings(self, name: str) -> Settings:
        """Of an engine's first profile."""
        profile, dt = next(iter(profiles_of(name).items()))
        return Settings(profile, dt, effects=self.effects, drive=self.drive)


ABILITIES = {
    "capsules": Asked("ladder"),
    "cylinders": Asked("cylinder_slides"),
    "ellipsoids": Asked("ellipsoid_rolls"),
    "hulls": Asked("tiles_slip"),
    "restitution": Asked("elastic_impacts"),
    "driven bodies": Asked("press"),
    "hinges of driven bodies": Asked("ball_snip"),
    "kinematic links": Asked("ball_snip", drive="posed"),
    "prescribed bodies": Asked("platform_stick"),
    "moving surfaces": Asked("belt"),
    "joints between bodies": Asked("cart_slope"),
    "static friction": Asked("slope_of_blocks"),
    "rolling friction": Asked("slope_of_balls"),
    "torsional friction": Asked("spins_to_rest"),
    "sleeping": Asked("stack", effects=("gravity", "rotation", "friction", "contact", "sleeping")),
}
"""Abilities beyond spheres, boxes and Coulomb's law, which all engines have."""
