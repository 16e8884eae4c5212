"""Table of Rapier's settings that `--set` changes, named as in IntegrationParameters and RigidBodyBuilder."""

from __future__ import annotations

from touchstone.adapters.engines.rapier import ENTRY
from touchstone.adapters.knobs import Choice, Range, Table

_MOST = 1e6
_SWITCH = {"no": 0, "yes": 1}


def _all(value: str) -> tuple[str, ...]:
    return (value,) * len(ENTRY.profiles)


SETTINGS = Table(
    ENTRY.profiles,
    (
        Choice(
            "friction_model",
            {"simplified": 0, "coulomb": 1},
            ("simplified", "simplified", "coulomb"),
            "friction of a manifold of up to four points: at its centre, with a twist, or at each point",
        ),
        Range("num_solver_iterations", 1, _MOST, "", ("12", "4", "12"), "substeps of a step"),
        Range("num_internal_pgs_iterations", 1, _MOST, "", _all("1"), "iterations of a substep"),
        Range(
            "num_internal_stabilization_iterations",
            0,
            _MOST,
            "",
            _all("1"),
            "iterations of a substep without the speed that removes overlap; with 0 it stays in the velocity",
        ),
        Choice("friction_in_bias_pass", _SWITCH, _all("no"), "friction while overlap is removed, too"),
        Range("warmstart_coefficient", 0, 1, "", _all("1.0"), "part of the last impulses", whole=False),
        Range("contact_frequency", 0, _MOST, "Hz", _all("30.0"), "of contacts as springs", whole=False),
        Range("contact_damping_ratio", 0, _MOST, "", _all("10.0"), "of contacts as springs", whole=False),
        Range(
            "static_contact_frequency",
            0,
            _MOST,
            "Hz",
            _all("60.0"),
            "of contacts with fixed bodies as springs",
            whole=False,
        ),
        Range(
            "static_contact_damping_ratio",
            0,
            _MOST,
            "",
            _all("10.0"),
            "of contacts with fixed bodies as springs",
            whole=False,
        ),
        Range(
            "normalized_max_corrective_velocity",
            0,
            _MOST,
            "m/s",
            _all("3.0"),
            "largest speed that removes overlap",
            whole=False,
        ),
        Range(
            "normalized_prediction_distance",
            0,
            10,
            "m",
            _all("0.02"),
            "gap from which on contacts are solved",
            whole=False,
        ),
        Range("num_threads", 1, 64, "", _all("1"), "of the world"),
        Range("max_ccd_substeps", 0, 1000, "", _all("1"), "of continuous detection; 0: none"),
        Choice("ccd_enabled", _SWITCH, _all("no"), "continuous detection between moving bodies, too"),
        Choice(
            "contact_recycling",
            _SWITCH,
            ("yes", "yes", "no"),
            "keep contacts of pairs that moved by up to 5 cm",
        ),
        Choice("allow_fast_rotation", _SWITCH, _all("no"), "no: at most 45 degrees of rotation a step"),
        Choice("gyroscopic_forces", _SWITCH, _all("yes"), "torque of the spin of unequal inertias"),
    ),
)
