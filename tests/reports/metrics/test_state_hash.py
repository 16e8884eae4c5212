"""The hash of states: equal in any process, and different by one bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import load
from touchstone.reports.metrics.solver import DIGITS, state_hash, state_hashed
from touchstone.reports.studies.stability.play import hard_cell, play_all
from touchstone.scenarios.difficulty.family import hard_scene

SCENE = "hard_mass_stack_10"
SETTINGS = Settings("balanced", 1 / 60)


@pytest.fixture(scope="module")
def recording():
    """A stack of two cubes, by the reference."""
    return record(load("reference"), hard_scene(SCENE)[0], SETTINGS)


def test_two_runs_in_a_process_have_one_hash(recording):
    """The reference repeats a run to the bit."""
    again = record(load("reference"), hard_scene(SCENE)[0], SETTINGS)
    assert state_hash(again) == state_hash(recording)


def test_a_bit_changes_the_hash(recording):
    """One unit in the last place of one number of one frame gives another hash, a clock does not."""
    position = recording.position.copy()
    position[-1, 1, 2] = np.nextafter(position[-1, 1, 2], np.inf)
    assert state_hash(replace(recording, position=position)) != state_hash(recording)
    assert state_hash(replace(recording, time_frame=recording.time_frame + 1)) == state_hash(recording)


@pytest.mark.spawned
def test_fresh_processes_and_their_number_do_not_change_the_hash(recording, tmp_path):
    """One process or two, whatever they played before: the same hash as in this process."""
    others = [
        hard_cell(f"hard_{name}", "reference", "balanced", 1 / 60) for name in ("mass_stack_1", "wedge_90")
    ]
    cell = hard_cell(SCENE, "reference", "balanced", 1 / 60)
    for number, cells in enumerate(([cell], [others[0], others[1], cell])):
        folder = tmp_path / str(number)
        played = play_all(cells, folder, lambda label, count: None, jobs=number + 1)
        assert played[cell].state_hash == state_hash(recording)


def test_the_metric_holds_the_digits(recording):
    """A float holds the first digits exactly, and the remark all of them."""

    class Context:
        pass

    context = Context()
    context.recording = recording
    found = state_hashed(context)[""]
    assert found.reason == state_hash(recording)
    assert f"{int(found.value):0{DIGITS}x}" == found.reason[:DIGITS]
