"""The study predictability: players that amplify by known factors must be told so."""

import numpy as np
import pytest

from touchstone.adapters.contract import Unsupported
from touchstone.reports.studies import predictability
from touchstone.reports.studies.predictability import (
    CLOSED_FORM,
    DRAWS,
    SCENES,
    SIZES,
    amplifications,
    directions,
    report,
    run,
    touching,
)
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.closed_form_ends import final_positions

FACTORS = {"reference": 1.0, "dart": 0.5, "bullet": 40.0, "mujoco": 1.0}
"""By which the player of an engine multiplies perturbations."""


@pytest.fixture
def played(recordings, in_this_process, tmp_path):
    """Run the study on the falling ball: engines end at its closed form, plus a factor times the shift."""

    def play(refuse=""):
        def record(task):
            if task.engine == refuse:
                raise Unsupported("cannot")
            scene, still = catalogue()["fall"], recordings.recording(task.scenario)
            shift = np.array(task.scenario.bodies[0].position) - scene.bodies[0].position
            position = still.position.copy()
            position[-1, 0] = final_positions(scene)[0] + FACTORS[task.engine] * shift
            return recordings.recording(task.scenario, position=position)

        in_this_process(predictability, record)
        return run([catalogue()["fall"]], 0, tmp_path / "out", lambda label, count: None)

    return play


def test_factors_are_found(played):
    """Find each engine's factor at every size, and its error beside the closed form's, which is 1."""
    frame = played()
    for engine, factor in (*FACTORS.items(), (CLOSED_FORM, 1.0)):
        rows = frame[(frame.engine == engine) & (frame.metric == predictability.METRIC)]
        assert rows.subject.tolist() == [f"{size:g} m" for size in SIZES]
        # 5 m of fall are known to 1e-15 m, of a perturbation of 1e-9 m
        for column in ("value", "low", "high"):
            np.testing.assert_allclose(rows[column], factor, rtol=1e-5)
    errors = frame[frame.metric == predictability.ERROR].groupby("engine").value.max()
    assert errors["bullet"] == pytest.approx(39, rel=1e-4)
    assert errors["dart"] == pytest.approx(0.5, rel=1e-4)
    assert frame[frame.metric == predictability.ERROR].low.isna().all()
    verdicts = frame[frame.metric == predictability.ERROR].groupby("engine").verdict.first()
    assert verdicts.to_dict() == {"reference": "pass", "dart": "", "bullet": "", "mujoco": ""}


def test_an_engine_that_cannot_is_skipped(played, shown):
    """Keep a row with the reason and the others' figures, and print both."""
    frame = played(refuse="dart")
    row = frame[frame.engine == "dart"]
    assert (list(row.verdict), list(row.reason)) == (["skipped"], ["cannot"])
    text = shown(report(frame), 120)
    assert "40.0 (40.0 to 40.0)" in text
    assert "skipped: dart recommended fall: cannot" in text


def test_directions_are_seeded_unit_vectors_that_press_nothing():
    """Draw the same unit vectors for one seed, others for another, across the normals of what touches."""
    scenario = catalogue()["cradle"]
    normals = np.zeros((1, 15))
    normals[0, [3, 6]] = -1.0, 1.0  # balls 2 and 3 along x
    found = directions(scenario, normals, 0)
    assert len(found) == DRAWS
    for one in found:
        assert np.linalg.norm(one) == pytest.approx(1.0, abs=1e-15)
        assert one[1, 0] == pytest.approx(one[2, 0], abs=1e-15)
        assert abs(one[0, 0] - one[1, 0]) > 1e-3
    assert np.array_equal(found, directions(scenario, normals, 0))
    assert not np.array_equal(found, directions(scenario, normals, 1))


def test_what_touches_at_the_start_is_found(recordings):
    """Find the three pairs of the cradle's row, and the ball on the table."""
    scenario = catalogue()["cradle"]
    rows = touching(recordings.recording(scenario), scenario)
    assert rows.shape == (3, 15)
    # each row pushes two neighbours apart along x
    np.testing.assert_allclose(np.sort(rows[:, 0::3], axis=1)[:, [0, -1]], [[-1, 1]] * 3, atol=1e-9)
    np.testing.assert_allclose(np.abs(rows).sum(axis=1), 2, atol=1e-6)
    fall = catalogue()["fall"]
    assert touching(recordings.recording(fall), fall).size == 0


def test_the_picture_is_drawn_even_without_scenes(played, tmp_path):
    """Write a picture beside the table, and one where nothing was measured."""
    frame = played()
    assert (tmp_path / "out" / "predictability.png").read_bytes().startswith(b"\x89PNG")
    amplifications(frame[frame.metric == "run"], tmp_path / "empty.png")
    assert (tmp_path / "empty.png").read_bytes().startswith(b"\x89PNG")
    assert set(SCENES) <= set(catalogue())
