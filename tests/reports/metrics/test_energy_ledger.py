"""The reference's ledger of energy against closed forms."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.reports.metrics.context import Context, NotMeasured
from touchstone.reports.metrics.motion.energy import energy_ledger

FRAME = 1 / 60
ROUNDING = 1e-12
"""Of energies of a few joules [J]: thousands of roundings."""


def ledger(registry: SimpleNamespace, scene) -> dict[str, float]:
    recording = record(registry.engine("reference"), scene, Settings("balanced", FRAME))
    return dict(energy_ledger(Context(recording, scene)))


def test_a_bounce_loses_by_restitution(lab: SimpleNamespace, registry: SimpleNamespace) -> None:
    """Lose (1 - e^2) m g h in one bounce, and nothing otherwise."""
    scene = lab.scene(lab.ground(), lab.ball(), e=0.6, duration=0.5)
    reported = ledger(registry, scene)
    # the impact is taken up to 7e-7 m above the ground
    assert reported["restitution"] == pytest.approx(-(1 - 0.6**2) * 9.81 * 0.95, abs=1e-5)
    assert reported["friction"] == reported["drive"] == 0
    assert abs(reported["correction"]) < ROUNDING


def test_a_sliding_box_loses_by_friction(lab: SimpleNamespace, registry: SimpleNamespace) -> None:
    """Lose all kinetic energy by friction."""
    box = lab.block("box", (0.1, 0.1, 0.1), (0.0, 0.0, 0.1), linear_velocity=(2.0, 0.0, 0.0))
    reported = ledger(registry, lab.scene(lab.ground(), box, mu=0.5))
    # every hold ends at a residual of 1e-12 m/s at most, which adds up over 0.4 s
    assert reported["friction"] == pytest.approx(-2.0, abs=1e-10)
    # the box stands 1e-6 m over the ground at most
    assert abs(reported["restitution"]) < 1e-9
    assert abs(reported["correction"]) < ROUNDING


def test_engines_tell_no_mechanisms(registry: SimpleNamespace, recordings: SimpleNamespace, lab) -> None:
    """Be measured on the reference alone."""
    scene = lab.scene(lab.ground(), lab.ball())
    with pytest.raises(NotMeasured, match="only the reference"):
        energy_ledger(Context(recordings.recording(scene), scene))
