"""Registry of the engines: implementing class (imported on demand), required package and profiles."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass

from touchstone.adapters.contract import AdapterError, Engine, NotInstalled, Settings, Unsupported


@dataclass(frozen=True, slots=True)
class Entry:
    """What the project needs to know of an engine; no other table names engines.

    Attributes:
        implementation: "module:Class".
        package: what must be importable.
        profiles: native step [s] of each profile.
        distribution: what is installed, where it is not called like the package.
        color, marker: of the engine in pictures, as matplotlib writes them.
        rounding: what the engine stores in lower precision; "" if nothing.

    Profiles: `recommended` is what the engine's documentation and maintainers recommend for such scenes, at
    the engine's default step, rounded down to a divisor of a frame of 1/60 s; `equal-step` is the same at one
    step for all engines; `default` keeps all defaults; `accurate` uses options of its documentation that
    improve Newton's and Coulomb's laws, as `touchstone study calibration` measures. Adapters cite the sources
    of their settings. `maximal` is Bullet with free balls and boxes in maximal coordinates: faster, with
    different results.
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
    """Whether an engine's package can be found; imports nothing."""
    return importlib.util.find_spec(_entry(name).package) is not None


def missing_reason(name: str) -> str:
    """Why an engine is skipped if it is not installed."""
    # numba is no extra: the project itself requires it.
    wanted = "touchstone" if name == "reference" else f"'touchstone[{name}]'"
    return f"not installed (pip install {wanted})"


def load(name: str) -> Engine:
    """Load the engine called `name`; raises NotInstalled with the extra that installs it."""
    if not installed(name):
        raise NotInstalled(missing_reason(name))
    module, _, attribute = _entry(name).implementation.partition(":")
    engine: Engine = getattr(importlib.import_module(module), attribute)()
    return engine


def profiles_of(name: str, profile: str = "") -> Mapping[str, float]:
    """Profiles of an engine with their native steps [s]; raises AdapterError with the valid names if the
    engine or the profile is unknown."""
    valid = _entry(name).profiles
    if profile and profile not in valid:
        raise AdapterError(f"{name}: no profile {profile!r}; valid: {', '.join(valid)}")
    return valid


def require_profile(name: str, settings: Settings) -> None:
    """Raise Unsupported if an engine lacks the profile or has no settings to change; names what it has."""
    valid = ENGINES[name].profiles
    if settings.profile not in valid:
        raise Unsupported(f"{name}: no profile {settings.profile!r}; valid: {', '.join(valid)}")
    if settings.changes:
        raise Unsupported(f"{name}: no settings to change, found {', '.join(settings.changes)}")


def _entry(name: str) -> Entry:
    if name not in ENGINES:
        raise AdapterError(f"unknown engine {name!r}; valid: {', '.join(ENGINES)}")
    return ENGINES[name]
