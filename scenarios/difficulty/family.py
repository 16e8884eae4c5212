"""Registry of the families of hard scenes: every function of `families/hard_*.py` marked `@family`.

A family builds a scene only when it is asked for: names, levels and units are known without. Its scenes are
called `hard_<family>_<level>`, have the tag `hard`, and 30 displayed frames per second, so that native steps
from 1/30 s on divide a frame.
"""

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from touchstone.scenarios.difficulty.checks import Case, Checks
from touchstone.scenarios.scenario import PairCoefficients, Scenario

TAG = "hard"
FRAME_RATE = 30
MATERIAL = "wood"
_MARK = "touchstone_family"


@dataclass(frozen=True, slots=True)
class Family:
    """Kind of difficulty.

    Attributes:
        name: name of the function that builds it.
        quantity, unit: what a level is.
        levels: from easy to absurd.
        build: the scene of a level.
    """

    name: str
    quantity: str
    unit: str
    levels: tuple[float, ...]
    build: Callable[[float], Case]

    @property
    def summary(self) -> str:
        return (self.build.__doc__ or "").strip().splitlines()[0]

    @property
    def posed(self) -> bool:
        """Whether no body is simulated: the reference poses all of them, and meets most checks by
        construction."""
        return all(body.kind != "simulated" for body in self.scene(self.levels[0])[0].bodies)

    def scene_name(self, level: float) -> str:
        return f"{TAG}_{self.name}_{level_text(level)}"

    def scene(self, level: float) -> tuple[Scenario, Checks]:
        case = self.build(level)
        fields: dict[str, object] = {
            "coefficients": (PairCoefficients(MATERIAL, MATERIAL, case.restitution, case.friction),),
            "frame_rate": FRAME_RATE,
        }
        fields.update(case.fields)
        scenario = Scenario(
            name=self.scene_name(level),
            summary=case.summary,
            tags=(TAG, *case.tags),
            bodies=case.bodies,
            duration=case.duration,
            truths=case.truths,
            **fields,  # type: ignore[arg-type]
        )
        return scenario, case.checks


def family(
    quantity: str, unit: str, levels: tuple[float, ...]
) -> Callable[[Callable[[float], Case]], Callable[[float], Case]]:
    """Mark a function of `families/hard_*.py` that builds the scene of a level."""

    def marked(build: Callable[[float], Case]) -> Callable[[float], Case]:
        setattr(build, _MARK, Family(build.__name__, quantity, unit, levels, build))
        return build

    return marked


@cache
def families() -> dict[str, Family]:
    """All families by name, in the order of their modules and functions."""
    import touchstone.scenarios.families as package

    found: dict[str, Family] = {}
    for info in pkgutil.iter_modules(package.__path__):
        if not info.name.startswith(f"{TAG}_"):
            continue
        module = importlib.import_module(f"touchstone.scenarios.families.{info.name}")
        for value in vars(module).values():
            one = getattr(value, _MARK, None)
            if isinstance(one, Family):
                if one.name in found:
                    raise ValueError(f"two families are called {one.name!r}")
                found[one.name] = one
    return found


def hard_names() -> dict[str, tuple[Family, float]]:
    """Family and level of every hard scene, by the scene's name; builds no scene."""
    return {one.scene_name(level): (one, level) for one in families().values() for level in one.levels}


@cache
def hard_scene(name: str) -> tuple[Scenario, Checks]:
    """Hard scene by name, and what must hold in it; raises KeyError if there is none of this name."""
    one, level = hard_names()[name]
    return one.scene(level)


def level_text(level: float) -> str:
    """Short text of a level: 1e-05 is 1e-5, 1e+06 is 1e6."""
    text = f"{level:g}"
    mantissa, e, exponent = text.partition("e")
    return f"{mantissa}e{int(exponent)}" if e else text
