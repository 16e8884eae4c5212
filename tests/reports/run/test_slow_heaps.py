"""Heaps on engines that are too slow for them."""

from dataclasses import replace

from touchstone.reports.results import rows_of
from touchstone.reports.run import study
from touchstone.reports.runner.request import Request
from touchstone.scenarios.catalogue import catalogue


def test_a_slow_engine_skips_the_rest_of_a_heap(monkeypatch, tmp_path):
    """Beyond its budget a column is skipped, with how far it came; scenes that are no heaps have none."""
    monkeypatch.setattr(study, "HEAP_BUDGET", 1e-9)
    scene = catalogue()["slip"]
    chosen = (replace(scene, name="heap", tags=("heap",)), scene)
    asked = Request(chosen, (("reference", "balanced"),), tmp_path / "run", metrics=("overlap.max",))
    rows = rows_of(study.run(asked, lambda label, frames: None).frame)
    (skipped,) = [row for row in rows if row.scenario == "heap"]
    assert (skipped.metric, skipped.verdict) == ("run", "skipped")
    assert skipped.reason.startswith("slow: its steps took ")
    assert skipped.reason.endswith(f" of {scene.frame_count} frames")
    assert any(row.metric == "overlap.max" for row in rows if row.scenario == "slip")
