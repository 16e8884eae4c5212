"""Noisy trackers on the reference: nothing passes, overlaps or diverges, whatever a tracker reports."""

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import ENGINES
from touchstone.reports.results import UNAPPLIED, Row
from touchstone.reports.verdict.judge import counted, judged
from touchstone.reports.verdict.rows import measured
from touchstone.scenarios.avatar.noisy_tracker import noisy
from touchstone.scenarios.catalogue import catalogue, tagged

QUICK = ("ball_snip", "volley")
"""A hand's scene and a person's; the rest of the gallery are slow tests."""
LAWS = ("overlap.max", "overlap.tunnelled", "solver.residual", "joint.limit")
CASES = [
    pytest.param(
        profile, scene.name, marks=[] if scene.name in QUICK and profile == "balanced" else pytest.mark.slow
    )
    for profile in ("balanced", "accurate")
    for scene in tagged("gallery")
]


@pytest.fixture(scope="module")
def noisy_rows(registry):
    """Judged rows of a gallery scene with noisy trackers, and its recording."""

    def play(profile: str, name: str):
        scene = noisy(catalogue()[name])
        dt = ENGINES["reference"].profiles[profile]
        settings = Settings(profile, dt, tracker="noisy")
        recording = record(registry.engine("reference"), scene, settings)
        base = Row("run", name, "reference", settings.label, dt, "run")
        return recording, [judged(row, scene.tags) for row in measured(base, scene, recording)]

    return play


@pytest.mark.parametrize(("profile", "scene"), CASES)
def test_laws_hold_with_noise(noisy_rows, profile, scene):
    """Stay finite, break no law, and count what follows from the ideal tracker as not applicable."""
    recording, rows = noisy_rows(profile, scene)
    assert np.isfinite(recording.position).all()
    assert len(recording.time) == catalogue()[scene].frame_count + 1
    assert [(row.metric, row.value) for row in rows if row.verdict in ("fail", "error")] == []
    assert {row.verdict for row in rows if row.metric in LAWS} == {"pass"}
    column = (rows[0].engine, rows[0].profile)
    apart = counted(rows, [column])[column].not_applicable
    unapplied = {row.metric for row in rows if row.basis == UNAPPLIED}
    assert unapplied
    assert unapplied <= set(apart)


def test_noise_repeats_to_the_bit(noisy_rows):
    """Play the same twice."""
    one, two = (noisy_rows("balanced", "ball_snip")[0] for _ in range(2))
    assert one.position.tobytes() == two.position.tobytes()
