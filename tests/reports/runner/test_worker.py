"""What a process that plays cells does with an engine that refuses the first of them."""

from __future__ import annotations

import pytest

from touchstone.adapters.contract import Unsupported
from touchstone.reports.runner import worker
from touchstone.reports.runner.worker import play_one


@pytest.fixture(autouse=True)
def _nothing_loaded(monkeypatch):
    monkeypatch.setattr(worker, "_engines", {})


def test_the_measure_decides_what_a_refused_warm_up_means(fakes):
    """A process whose first scene is refused still measures: the measure says what a refusal is."""
    from fake_measures import Engine, load

    class Choosy(Engine):
        def build(self, scenario, settings):
            raise Unsupported("no balls")

    (cell,) = fakes("square", 1)
    assert play_one(cell, lambda name: Choosy()).outcome == "done"
    assert worker._engines == {}
    assert play_one(cell, load).outcome == "done"
    assert list(worker._engines) == [(load, "mujoco")]
