"""What is simulated, as plain data. Knows no engine.

`touchstone.scenarios()` gives all scenes of the catalogue by name.
"""

import sys
from types import ModuleType


class _Scenarios(ModuleType):
    """This package as a function: the public API names both alike."""

    def __call__(self, tag: str = ""):  # type: ignore[no-untyped-def]
        """All scenes by name, or those with a tag: dict of `Scenario`."""
        from touchstone.scenarios.catalogue import catalogue

        return {name: scene for name, scene in catalogue().items() if not tag or tag in scene.tags}


sys.modules[__name__].__class__ = _Scenarios

import touchstone.scenarios.validation  # noqa: E402, F401  adds its checks to those of `Scenario`
