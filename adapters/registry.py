"""The engines: where each is implemented (imported on demand), what must be installed, and its profiles."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass

from touchstone.adapters.contract import AdapterError, Engine, NotInstalled, Settings, Unsupported


@dataclass(frozen=True, slots=True)
class Entry:
    """All that others know of an engine: no other table names engines.

    Attributes:
        implementation: "module:Class".
        package: what must be importable.
        profiles: native step [s] of each profile.
        distribution: what is installed, where it is not called like the package.
        color, marker: of the engine in pictures, as matplotlib writes them.
        rounding: what the engine stores less exactly than it is told; "" if nothing.

    `recommended` is what the engine's documentation and maintainers recommend for such scenes, at the
    engine's default step, rounded to the next smaller divisor of a frame of 1/60 s; `equal-step` is the same
    at one step for all; `default` is as the engine comes; `accurate` is what its documentation offers to meet
    Newton's and Coulomb's laws better, as `touchstone study calibration` measures. Adapters cite what they
    set. `maximal` is Bullet with free balls and boxes in maximal coordinates: faster, and not the same.
    """

    implementation: str
    package: str
    profiles: Mapping[str, float]
    distribution: str = ""
    color: str = "#666666"
    marker: str = "P"
    rounding: str = ""


EQUAL_STEP = 1 / 240
RECOMMENDED, DEFAULT, ACCURATE, MAXIMAL = "recommended", "default", "accurate", "maximal"
ENGINES: dict[str, Entry] = {
    "reference": Entry(
        "touchstone.adapters.engines.reference.engine:ReferenceEngine",
        "numba",
        {"balanced": 1 / 60, "paper": 1 / 60, "accurate": 1 / 60},
        distribution="touchstone",
        color="#000000",
        marker="o",
    ),
    "dart": Entry(
        "touchstone.adapters.engines.dart.engine:DartEngine",
        "dartpy",
        {RECOMMENDED: 1 / 1020, "equal-step": EQUAL_STEP, DEFAULT: 1 / 1020, ACCURATE: 1 / 1020},
        color="#AA4499",
        marker="^",
        rounding="vertices of hulls in single precision",
    ),
    "bullet": Entry(
        "touchstone.adapters.engines.bullet.engine:BulletEngine",
        "pybullet",
        {
            RECOMMENDED: 1 / 240,
            "equal-step": EQUAL_STEP,
            DEFAULT: 1 / 240,
            ACCURATE: 1 / 960,
            MAXIMAL: 1 / 240,
        },
        color="#B8860B",
        marker="s",
        rounding="corners of hulls rounded to about 1e-4 of their size",
    ),
    "mujoco": Entry(
        "touchstone.adapters.engines.mujoco.engine:MujocoEngine",
        "mujoco",
        {RECOMMENDED: 1 / 540, "equal-step": EQUAL_STEP, DEFAULT: 1 / 540, ACCURATE: 1 / 1920},
        color="#009E73",
        marker="D",
        rounding="vertices of hulls in single precision",
    ),
}


def installed(name: str) -> bool:
    """Whether the package behind an engine can be found; imports nothing."""
    return importlib.util.find_spec(_entry(name).package) is not None


def missing_reason(name: str) -> str:
    """Why an engine is skipped when it is not installed."""
    # numba is no extra: the project itself brings it
    wanted = "touchstone" if name == "reference" else f"'touchstone[{name}]'"
    return f"not installed (pip install {wanted})"


def load(name: str) -> Engine:
    """The engine called `name`; raises NotInstalled with the extra that brings it."""
    if not installed(name):
        raise NotInstalled(missing_reason(name))
    module, _, attribute = _entry(name).implementation.partition(":")
    engine: Engine = getattr(importlib.import_module(module), attribute)()
    return engine


def profiles_of(name: str, profile: str = "") -> Mapping[str, float]:
    """The profiles of an engine with their native steps [s]; raises AdapterError with the valid names where
    the engine, or the profile asked for, is unknown."""
    valid = _entry(name).profiles
    if profile and profile not in valid:
        raise AdapterError(f"{name}: no profile {profile!r}; valid: {', '.join(valid)}")
    return valid


def require_profile(name: str, settings: Settings) -> None:
    """Raise Unsupported where an engine has no such profile, or no settings to change; names what it has."""
    valid = ENGINES[name].profiles
    if settings.profile not in valid:
        raise Unsupported(f"{name}: no profile {settings.profile!r}; valid: {', '.join(valid)}")
    if settings.changes:
        raise Unsupported(f"{name}: no settings to change, found {', '.join(settings.changes)}")


def _entry(name: str) -> Entry:
    if name not in ENGINES:
        raise AdapterError(f"unknown engine {name!r}; valid: {', '.join(ENGINES)}")
    return ENGINES[name]
