"""Scenes as plain data, independent of any engine.

`touchstone.scenarios()` returns all scenes of the catalogue by name.
"""

import sys
from types import ModuleType


class _Scenarios(ModuleType):
    """Callable package: the public API uses one name for the package and for the function."""

    def __call__(self, tag: str = ""):  # type: ignore[no-untyped-def]
        """All scenes by name except hard ones, or those with a tag: dict of `Scenario`."""
        from touchstone.scenarios.catalogue import catalogue, tagged

        return {scene.name: scene for scene in tagged(tag)} if tag else dict(catalogue())


sys.modules[__name__].__class__ = _Scenarios

import touchstone.scenarios.validation  # noqa: E402, F401  adds its checks to those of `Scenario`
