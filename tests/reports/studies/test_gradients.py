"""The study `gradients`: closed forms against differences of closed motions, and of the reference."""

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.registry import load
from touchstone.adapters.workers.pool import Ended
from touchstone.reports.results import table
from touchstone.reports.studies import gradients
from touchstone.reports.studies.gradients import (
    CASES,
    JUDGED,
    LIMIT,
    SIZES,
    STARTS,
    Task,
    errors,
    errors_picture,
    report,
    rows_of_task,
)
from touchstone.scenarios.closed_form_ends import final_positions

STEP = 1e-6


@pytest.mark.parametrize("name", ["elastic balls", "unequal balls", "bounce", "bounce three times"])
def test_closed_forms_are_differences_of_final_positions(name):
    """Derivatives of positions, against central differences of another closed form, at every start."""
    case = CASES[name]
    for start in case.starts():
        for one in case.truth(start):
            field, body = case.outputs[one.output]
            if field != "position":
                continue
            step = STEP * (abs(start[one.parameter]) or 1.0)
            high, low = (
                final_positions(case.scene({**start, one.parameter: start[one.parameter] + sign * step}))
                for sign in (1, -1)
            )
            ends = [end[min(body, len(end) - 1), case.axis] for end in (high, low)]
            assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(one.value, rel=1e-6, abs=1e-8), one.name


@pytest.mark.parametrize("name", CASES)
def test_the_reference_equals_the_closed_forms(monkeypatch, name):
    """To 1e-5 at the judged step, at every start."""
    engine, profile, size = JUDGED
    monkeypatch.setattr(gradients, "SIZES", (size,))
    task = Task(name, engine, Settings(profile, 1 / 60))
    found = errors(load(engine), task)
    assert found.shape[1:] == (1, STARTS)
    assert found.max() < LIMIT
    rows = rows_of_task(task, found)
    assert {row.verdict for row in rows if row.limit == LIMIT} == {"pass"}


def test_a_wrong_derivative_fails_and_is_drawn(shown, tmp_path):
    """An error beyond the limit is a failed row; table and picture show it, and an engine that ended."""
    engine, profile, _ = JUDGED
    task = Task("slide", engine, Settings(profile, 1 / 60))
    wrong = np.full((3, len(SIZES), STARTS), 1e-9)
    wrong[1, :, 2] = 2e-5
    rows = rows_of_task(task, wrong)
    assert [row.subject for row in rows if row.verdict == "fail"] == ["d stop / d mu, h 0.0001"]
    rows += rows_of_task(task, Ended("error", "it broke"))
    frame = table(rows)
    text = shown(report(frame), 120)
    for said in ("d stop / d v", "1e-09 1e-09 1e-09", "it broke", "largest of the 3 judged: 2e-05"):
        assert said in text
    errors_picture(frame, tmp_path / "gradients.png")
    assert (tmp_path / "gradients.png").stat().st_size > 5000
