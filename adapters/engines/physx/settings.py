"""Table of PhysX's settings that `--set` changes, named as in SAPIEN."""

from __future__ import annotations

from touchstone.adapters.engines.physx import ENTRY
from touchstone.adapters.knobs import Choice, Range, Table

_SWITCH = {"no": 0, "yes": 1}


def _all(value: str) -> tuple[str, ...]:
    return (value,) * len(ENTRY.profiles)


SETTINGS = Table(
    ENTRY.profiles,
    (
        Choice(
            "solver",
            {"pgs": 0, "tgs": 1},
            ("tgs", "tgs", "pgs"),
            "projected Gauss-Seidel, or temporal, whose position iterations are substeps",
        ),
        Range("solver_position_iterations", 1, 255, "", _all("10"), "of each body"),
        Range("solver_velocity_iterations", 0, 255, "", _all("1"), "of each body"),
        Range(
            "bounce_threshold",
            0,
            1e3,
            "m/s",
            ("0.2", "2.0", "0.2"),
            "approach up to which nothing bounces",
            whole=False,
        ),
        Range("contact_offset", 1e-6, 10, "m", _all("0.01"), "of each shape: gap with contacts", whole=False),
        Range("rest_offset", -1, 1, "m", _all("0.0"), "of each shape: gap at which it rests", whole=False),
        Range(
            "angular_damping",
            0,
            1e3,
            "1/s",
            ("0.0", "0.05", "0.0"),
            "of each body",
            whole=False,
        ),
        Range("max_angular_velocity", 1e-3, 1e6, "rad/s", _all("100.0"), "of each body", whole=False),
        Range("cpu_workers", 0, 64, "", _all("0"), "threads of the scene; 0: the calling one"),
        Choice("enable_pcm", _SWITCH, _all("yes"), "persistent contact manifolds"),
        Choice("enable_ccd", _SWITCH, _all("no"), "continuous detection, as SAPIEN enables it"),
        Choice("enable_friction_every_iteration", _SWITCH, _all("yes"), "no: in the last three iterations"),
        Choice("enable_enhanced_determinism", _SWITCH, _all("no"), "islands do not depend on others"),
    ),
)
