"""The study agreement: players whose errors are known must come out with that model and outlier."""

from math import inf, isnan
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from touchstone.adapters.contract import Unsupported
from touchstone.reports.results import COLUMNS
from touchstone.reports.runner.cells import Cell
from touchstone.reports.runner.tasks import Task
from touchstone.reports.studies import agreement
from touchstone.reports.studies.agreement import LADDER, Trajectory, order_of, report, run
from touchstone.reports.studies.work_precision import points
from touchstone.reports.studies.work_precision.points import CellRun, SweptRuns
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.closed_form import motion

ORDERS = {"reference": (0.0, inf), "dart": (0.0, 1.0), "bullet": (0.0, 2.0), "mujoco": (0.05, 1.0)}
"""Per engine the error [m] that no step mends, and the order at which the rest vanishes."""


@pytest.fixture
def played(recordings: SimpleNamespace, in_this_process, tmp_path: Path):
    """Run the study on the falling ball: engines play the truth, off to the side by the model's error and by
    dt to the order; one refuses steps above a length."""

    def play(refuse: str = "", above: float = 0.0) -> pd.DataFrame:
        def record(task: Task) -> object:
            if task.engine == refuse and task.settings.dt > above:
                raise Unsupported("cannot")
            still = recordings.recording(task.scenario)
            position = still.position.copy()
            model, order = ORDERS[task.engine]
            for truth in task.scenario.truths:
                body = task.scenario.body_index(truth.body)
                position[:, body] = motion(task.scenario, truth, still.time).position
                position[1:, body, 0] += model + task.settings.dt**order
            return recordings.recording(task.scenario, position=position)

        in_this_process(agreement, record)
        return run([catalogue()["fall"]], tmp_path / "out", lambda label, count: None)

    return play


def value(frame: pd.DataFrame, engine: str, metric: str) -> float:
    part = frame[(frame.engine == engine) & (frame.metric == metric) & (frame.subject == "position")]
    assert len(part) == 1
    return float(part.value.iloc[0])


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0, 4.0])
def test_a_power_law_gives_its_exponent(order: float) -> None:
    """Find the order of changes that follow a power of the step, with no width."""
    dt = np.array(LADDER[:-1])
    slope, low = order_of(dt, 1e5 * dt**order)
    assert slope == pytest.approx(order, abs=1e-12)
    assert slope - low < 1e-6


def test_rounding_has_no_order() -> None:
    """Give no order where steps change nothing."""
    assert all(isnan(number) for number in order_of(np.array(LADDER[:-1]), np.full(len(LADDER) - 1, 1e-13)))


def test_the_parts_of_an_error_are_told_apart(played) -> None:
    """Find each engine's model error and what its own step adds; name the engine that stands apart, and whose
    error does not fall."""
    frame = played()
    assert tuple(frame.columns) == COLUMNS
    fall = catalogue()["fall"]
    ends = motion(fall, fall.truths[0], np.array([0.0, fall.duration])).position
    way = float(np.linalg.norm(ends[1] - ends[0]))
    for engine in ("reference", "dart", "bullet"):
        assert value(frame, engine, "agreement.model") == pytest.approx(0, abs=1e-9)
    assert value(frame, "mujoco", "agreement.model") == pytest.approx(0.05 / way, rel=1e-6)
    own = agreement.ENGINES["mujoco"].profiles["recommended"]
    assert value(frame, "mujoco", "agreement.discretisation") == pytest.approx(own / way, rel=1e-6)
    positions = frame[frame.subject == "position"]
    assert list(positions[positions.metric == "agreement.outlier"].reason) == ["mujoco"]
    models = positions[positions.metric == "agreement.model"]
    assert list(models[models.reason.str.contains("does not fall")].engine) == ["mujoco"]


def test_an_engine_that_cannot_is_skipped(played, shown) -> None:
    """Keep a row with the reason, and the others' rows; print both, and the mark of the outlier."""
    frame = played(refuse="dart")
    row = frame[frame.engine == "dart"]
    assert list(row.verdict) == ["skipped"]
    assert list(row.reason) == ["cannot"]
    assert value(frame, "bullet", "agreement.model") == pytest.approx(0, abs=1e-9)
    text = shown(report(frame), 120)
    assert "mujoco*" in text
    assert "skipped: dart recommended fall: cannot" in text


def test_an_engine_that_refuses_coarse_steps_is_compared_at_the_others(played) -> None:
    """Its limit comes from the steps that it plays; the refused one has a row."""
    frame = played(refuse="dart", above=1 / 200)
    refused = frame[(frame.engine == "dart") & (frame.metric == "run")]
    assert refused.dt.tolist() == [LADDER[0]]
    assert value(frame, "dart", "agreement.model") < 1e-9


def test_a_scene_without_a_closed_form_is_measured_against_a_band(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, shown
) -> None:
    """Name the code off the band that the others span, and the distance of each own step."""
    scene = catalogue()["push_box"]
    still = np.zeros((scene.frame_count + 1, 1, 3))
    moved = np.linspace(0, 1, scene.frame_count + 1)[:, None, None] * np.array([1.0, 0, 0]) + still
    places = {"reference": 0.1, "dart": 0.0, "bullet": 0.01, "mujoco": 0.02}
    assert {one.settings.drive for one in agreement.own_cells(scene)} == {"posed"}

    def run_of(_: object, cell: Cell) -> CellRun:
        off = places[cell.engine] + (0.005 if cell.profile in ("balanced", "recommended") else 0.0)
        return CellRun(_NO_ROWS, moved + np.array([0.0, off, 0.0]), still[:, 0, 0])

    monkeypatch.setattr(SweptRuns, "run", run_of)
    monkeypatch.setattr(agreement, "sweep", lambda *_, **__: _NO_ROWS)
    for module in (agreement, points):
        monkeypatch.setattr(module, "installed", lambda engine: engine in places)
    frame = run([scene], tmp_path / "out", lambda label, count: None)
    (band,) = frame[frame.metric == "agreement.band"].to_dict("records")
    assert band["value"] == pytest.approx(0.02)
    assert band["reason"] == "dart, bullet, mujoco agree to 20 mm; reference is 80 mm off"
    errors = frame[frame.metric == "agreement.error"].set_index("engine").value
    assert errors.to_dict() == pytest.approx({"reference": 0.085, "dart": 0, "bullet": 0, "mujoco": 0.005})
    assert "reference is 80 mm off" in shown(report(frame), 120)


_NO_ROWS = pd.DataFrame({"cell": [], "metric": [], "subject": [], "value": [], "verdict": []})


def test_limits_of_turns_are_extrapolated() -> None:
    """Find the limit of positions and turns whose error is proportional to the step."""
    fine, coarse = (
        Trajectory(np.full((1, 1, 3), 1 + h), np.array([[[np.cos(h / 2), np.sin(h / 2), 0.0, 0.0]]]))
        for h in (0.1, 0.2)
    )
    limit = fine.limit(coarse, 1.0)
    np.testing.assert_allclose(limit.position, 1.0, atol=1e-15)
    np.testing.assert_allclose(np.abs(limit.orientation), [[[1.0, 0.0, 0.0, 0.0]]], atol=1e-15)
