"""Engine name -> "module:Class", imported on demand; the extra of pyproject.toml that brings it."""

from __future__ import annotations

import importlib
import importlib.util

from adapters.engine import Engine, NotInstalled

ENGINES: dict[str, tuple[str, str]] = {
    # name: (module:Class, package that must be importable)
    "reference": ("adapters.reference_engine:ReferenceEngine", "numba"),
    "dart": ("adapters.dart_engine:DartEngine", "dartpy"),
    "bullet": ("adapters.bullet_engine:BulletEngine", "pybullet"),
    "mujoco": ("adapters.mujoco_engine:MujocoEngine", "mujoco"),
}


def installed(name: str) -> bool:
    """Whether the package behind an engine can be found; imports nothing."""
    return importlib.util.find_spec(ENGINES[name][1]) is not None


def missing_reason(name: str) -> str:
    """Why an engine is skipped when it is not installed."""
    return f"not installed (pip install 'touchstone[{name}]')"


def load(name: str) -> Engine:
    """The engine called `name`; raises NotInstalled with the extra that brings it."""
    if not installed(name):
        raise NotInstalled(missing_reason(name))
    module, _, attribute = ENGINES[name][0].partition(":")
    engine: Engine = getattr(importlib.import_module(module), attribute)()
    return engine
