"""The study of effects: what it plays, what it says of outcomes, and its means."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest
from fake_world import FakeWorld

from touchstone.adapters.contract import Settings
from touchstone.adapters.workers.variants import BLOCK, Pace, Variant, _time, play
from touchstone.reports.results import Row, rows_of
from touchstone.reports.runner.tasks import Task, own_settings
from touchstone.reports.studies import effects
from touchstone.reports.studies.effects import ALL, IDENTICAL, MATTERS, WITHIN
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.effects import PLANNED

BASE = Row("effects", "fall", "reference", "balanced", 1 / 60, "")


def pace(seconds: float, crossing: float = 0.0) -> Pace:
    """Forty frames that each take so long."""
    return Pace(np.full(40, seconds), np.full(40, crossing))


def variant(seconds: float, beside: float = 1e-6, crossing: float = 0.0, **reported: object) -> Variant:
    """Frames beside others, with the same outcome unless told otherwise."""
    facts: dict[str, object] = {"moved": 0.0, "turned": 0.0, "same": True, "ended": ""}
    return Variant(pace(seconds, crossing), pace(beside, crossing), **facts | reported)


def by_metric(rows: list[Row]) -> Mapping[tuple[str, str], Row]:
    """Rows by metric and subject."""
    return {(row.metric, row.subject): row for row in rows}


def test_times_are_net_of_the_crossing() -> None:
    """Take the crossing off both times of the reference, and off no engine's."""
    played = {"": variant(2e-6), ALL: variant(3e-6, 2e-6, crossing=1e-6)}
    saved = by_metric(effects.rows_of_variants(BASE, played))["time.saved", ALL]
    assert saved.value == pytest.approx(0.5)
    other = Row("effects", "fall", "mujoco", "recommended", 1 / 540, "")
    assert by_metric(effects.rows_of_variants(other, played))["time.saved", ALL].value == pytest.approx(1 / 3)


@pytest.mark.parametrize(
    ("reported", "word"),
    [
        ({}, IDENTICAL),
        ({"same": False, "moved": 1e-9}, WITHIN),
        ({"same": False, "moved": 1e-5}, MATTERS),
        ({"same": False, "turned": 1e-5}, MATTERS),
    ],
)
def test_outcomes_in_words(reported: dict[str, object], word: str) -> None:
    """Distinguish identical outcomes, those within tolerance, and those that differ."""
    rows = effects.rows_of_variants(BASE, {"": variant(1e-6), "-gravity": variant(1e-6, **reported)})
    moved = by_metric(rows)["effects.moved", "-gravity"]
    assert moved.reason_code == word


def test_a_variant_that_ends_is_told() -> None:
    """Keep a row for what cannot be played without an effect."""
    rows = effects.rows_of_variants(BASE, {"": variant(1e-6), "-contact": variant(1e-6, ended="stuck")})
    assert by_metric(rows)["run", "-contact"].reason == "-contact: stuck"


def test_means_are_geometric() -> None:
    """Take the geometric mean of what is left, by group."""
    rows = [
        Row("effects", name, "reference", "balanced", 1 / 60, "time.saved", 1 - left, "1", ALL, 0, 0, 0, 0.9)
        for name, left in (("a", 0.25), ("b", 1.0), ("c", 0.5))
    ]
    found = effects.means(rows, {"a": ("probe",), "b": ("probe",), "c": ("gallery",)})
    assert {row.scenario: row.value for row in found} == pytest.approx({"probe": 0.5, "gallery": 0.5})


def test_variants_of_a_fall(registry) -> None:
    """Find a fall with its plan identical to all effects, and half a metre and more off without gravity."""
    wanted = (None, PLANNED, ("rotation",))
    settings = [Settings("balanced", 1 / 60, effects=one) for one in wanted]
    mine, whole, without = play(registry.engine("reference"), catalogue()["fall"], settings)
    assert mine.same
    assert whole.same
    assert not without.same
    assert without.moved > 0.5
    assert len(mine.pace.seconds) == len(whole.pace.net) == catalogue()["fall"].frame_count


@pytest.mark.engines
def test_a_plan_that_changes_no_world_is_not_timed(registry) -> None:
    """All bodies of a bounce meet, so that it is played once; without friction MuJoCo has other cones, and
    Bullet keeps what saves it nothing."""
    engine = registry.engine("mujoco")
    for name, same in (("bounce_e05", True), ("collide_central", False), ("spring", False)):
        task = Task(catalogue()[name], "mujoco", own_settings("mujoco"))
        _, found = effects.measure(engine, task)
        assert (found[""] is found[ALL]) == same
    bullet = registry.engine("bullet")  # without shapes or gravity its steps take no less time
    for name in ("slap_6", "spring"):
        _, found = effects.measure(bullet, Task(catalogue()[name], "bullet", own_settings("bullet")))
        assert found[""] is found[ALL]
    _, found = effects.measure(engine, Task(catalogue()["bounce_e05"], "mujoco", own_settings("mujoco")))
    rows = by_metric(effects.rows_of_variants(replace(BASE, engine="mujoco"), found))
    assert rows["time.saved", ALL].value == rows["time.saved", ALL].low == rows["time.saved", ALL].high == 0


def test_passes_time_a_variant_beside_the_first(registry) -> None:
    """Time pairs in passes of their own: all frames but the first of a world, each with its crossing."""
    settings = [Settings("balanced", 1 / 60, effects=one) for one in (None, PLANNED)]
    mine, whole = play(registry.engine("reference"), catalogue()["fall"], settings, passes=2)
    assert len(whole.pace.seconds) == len(whole.beside.crossing) == catalogue()["fall"].frame_count - 1
    assert (whole.pace.crossing > 0).all()
    assert np.array_equal(mine.pace.seconds, whole.beside.seconds)


@pytest.mark.parametrize(("whole", "verdict"), [(True, "fail"), (False, "")])
def test_means_of_a_selection_have_no_limit(tmp_path, monkeypatch, whole, verdict) -> None:
    """A stack needs all effects all the time: alone it breaks no limit on the mean of the probes."""
    stack = catalogue()["stack"]
    monkeypatch.setattr(effects, "scenes", lambda: [stack] if whole else [stack, catalogue()["fall"]])
    found = (np.zeros(0), {"": variant(1e-6), ALL: variant(1e-6)})
    monkeypatch.setattr(effects, "played", lambda *_, **__: [found])
    frame = effects.run([stack], ["reference"], tmp_path / "out", lambda label, steps: None)
    (row,) = (row for row in rows_of(frame) if row.metric == "time.left")
    assert (row.value, row.verdict) == (pytest.approx(1.0), verdict)


def test_a_frame_is_timed_beside_one_of_its_own_variant() -> None:
    """Two worlds of a variant step in turn; variants take turns by blocks that begin elsewhere each pass."""
    order: list[bool] = []

    class Counted(FakeWorld):
        def step(self) -> None:
            super().step()
            order.append(self.settings.effects is None)

        def read(self, state) -> None:
            state.position[:] = [body.position for body in self.scenario.bodies]

    class Fake:
        name = "fake"

        def build(self, scenario, settings):
            return Counted("fake", scenario, settings)

    fall = catalogue()["fall"]
    pair = [replace(Settings("any", 1 / 60), effects=names) for names in (None, PLANNED)]
    _time(Fake(), fall, pair, BLOCK + 3, 4)
    blocks = [(plan, len(list(steps)) // 2) for plan, steps in groupby(order)]
    first, second = (1, BLOCK, 2), (1 + BLOCK // 2, 2 + BLOCK // 2)
    assert [n for plan, n in blocks if plan] == [*first, *second]
    # the second pass begins with the variant that ended the first
    assert [n for plan, n in blocks if not plan] == [*first[:2], first[2] + second[0], second[1]]


def test_a_budget_ends_all_variants_together(registry) -> None:
    """Stop after the frame in which the steps of all took as long as allowed."""
    settings = [Settings("balanced", 1 / 60, effects=one) for one in (None, PLANNED)]
    variants = play(registry.engine("reference"), catalogue()["stack"], settings, budget=1e-9)
    assert [len(one.pace.seconds) for one in variants] == [1, 1]


@pytest.mark.slow
def test_the_study_as_a_whole(shown, tmp_path: Path) -> None:
    """Play two scenes: identical outcomes, each effect marked, a table, a picture, and nothing half done."""
    chosen = [catalogue()[name] for name in ("fall", "bounce_e05")]
    frame = effects.run(chosen, ["reference"], tmp_path / "out", lambda label, steps: None)
    assert {p.name for p in (tmp_path / "out").iterdir()} >= {"results.csv", "results.parquet", "effects.png"}
    rows = {(r.scenario, r.engine, r.metric, r.subject): r for r in rows_of(frame)}
    for scene in ("fall", "bounce_e05"):
        assert rows[scene, "reference", "effects.changed", ALL].verdict == "pass"
        assert rows[scene, "reference", "time.plan", ""].value > 0
        saved = rows[scene, "reference", "time.saved", ALL]
        assert saved.low <= saved.high
    marks = [effects.mark(rows, "bounce_e05", effect) for effect in ("gravity", "restitution", "attraction")]
    assert marks == ["M", "M", "."]
    assert "identical" in shown(effects.report(frame))
