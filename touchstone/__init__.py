"""Contact handling for avatars: a reference implementation, and DART, Bullet and MuJoCo on the same scenes.

    import touchstone

    results = touchstone.run(["fall", "ball_snip"], engines=["reference", "mujoco"])
    results.frame  # every metric of every run, a row each
    results.recordings["fall", "mujoco", "recommended"].position  # (f, n, 3) [m]

`run` plays scenes and judges them, `sweep` measures a grid of settings, `scenarios` lists them, `load` reads
a recording from a file. `assert_...` raises InvariantError where a run breaks a law; `recording` makes one of
plain arrays. `Scenario` and its parts describe a scene of your own; `SimpleWorld` is the base of an engine of
your own. Names are imported when they are used.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from typing import Any

_PARTS = (
    "Body",
    "Box",
    "Capsule",
    "Chain",
    "Cone",
    "Cylinder",
    "Ellipsoid",
    "Expectation",
    "HalfSpace",
    "Hull",
    "Joint",
    "MetricLimit",
    "PairCoefficients",
    "Piece",
    "ReachCone",
    "RoundedBox",
    "RoundedHull",
    "Scenario",
    "ScenarioError",
    "Sphere",
    "Tracker",
    "Truth",
)
_ASSERTIONS = (
    "assert_energy_not_created",
    "assert_friction_cone",
    "assert_heading_independent",
    "assert_momentum_kept",
    "assert_no_overlap",
    "assert_no_tunnelling",
    "assert_restitution",
)
_REPEATS = ("assert_deterministic", "assert_order_independent", "reordered")
_ADAPTER = ("BodyFacts", "Manifest", "PairFacts", "Settings", "State", "Unsupported")
_HOME = {
    "run": "touchstone.reports.api",
    "sweep": "touchstone.reports.api",
    "work_precision": "touchstone.reports.api",
    "Results": "touchstone.reports.runner.request",
    "Recording": "touchstone.adapters.recording",
    "load": "touchstone.adapters.recording",
    "scenarios": "touchstone.scenarios",
    "recording": "touchstone.reports.assertions.arrays",
    **dict.fromkeys(_ASSERTIONS, "touchstone.reports.assertions.invariants"),
    **dict.fromkeys(_REPEATS, "touchstone.reports.assertions.invariants"),
    "InvariantError": "touchstone.reports.assertions.outcome",
    **dict.fromkeys(_ADAPTER, "touchstone.adapters.contract"),
    "SimpleWorld": "touchstone.adapters.engines.simple_world",
    **dict.fromkeys(_PARTS, "touchstone.scenarios.scenario"),
    "ForceTruth": "touchstone.scenarios.truths.force_truth",
    "Published": "touchstone.scenarios.truths.published",
}

__all__ = [*_HOME]

_FOLDERS = ("adapters", "reference_impl", "reports", "scenarios")


def _check_folders() -> None:
    """End with one line if, in a checkout, links of an older one remain, or its folders are not installed."""
    here = __path__[0]
    root = os.path.dirname(here)
    if not os.path.exists(os.path.join(root, "pyproject.toml")):
        return
    links = [path for name in _FOLDERS if os.path.islink(path := os.path.join(here, name))]
    found = importlib.util.find_spec("touchstone.reports")
    place = os.path.dirname(found.origin) if found and found.origin else ""
    if not links and place == os.path.realpath(os.path.join(root, "reports")):
        return
    import shlex

    pip = shlex.join([sys.executable, "-m", "pip"])
    install = f"{pip} install -e {shlex.quote(root)}"
    if links:
        # an install beside links maps no folders
        reason = "links of an older checkout are in the way"
        install = f"{shlex.join(['rm', *links])} && {install}"
    elif place:
        reason = f"this Python has another checkout installed, {os.path.dirname(place)}"
        # installed under the distribution's earlier name it would still come first
        install = f"{pip} uninstall -y touchstone && {install}"
    else:
        reason = "not installed, or installed before its sources moved"
    raise SystemExit(f"touchstone: {reason}; run: {install}")


_check_folders()


def __getattr__(name: str) -> Any:
    """A public name, imported when it is used first."""
    if name not in _HOME:
        raise AttributeError(f"touchstone has no {name!r}; its names are {', '.join(sorted(_HOME))}")
    module = importlib.import_module(_HOME[name])
    return module if name == "scenarios" else getattr(module, name)


def __dir__() -> list[str]:
    return sorted(_HOME)
