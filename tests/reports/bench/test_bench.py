"""`touchstone bench`: whole folders or none; `bench scaling` on power laws and on fakes."""

from math import nan
from pathlib import Path

import numpy as np
import pytest
from fake_detectors import load as load_detector
from fake_steppers import load as load_stepper

from touchstone.adapters.contract import Settings
from touchstone.adapters.detectors import REFERENCE
from touchstone.adapters.engines.reference.engine import ReferenceEngine
from touchstone.adapters.recorder import warm_up
from touchstone.reports.bench import BENCHES, load, scaling
from touchstone.reports.bench.scaling import (
    BALLS,
    BROAD_PHASE,
    VERTICES,
    Amount,
    Curve,
    balls_at_rest,
    resting_balls,
    rows_of_curves,
)
from touchstone.reports.progress import quietly
from touchstone.reports.results import Row, table
from touchstone.reports.verdict import limits
from touchstone.reports.verdict.judge import judged
from touchstone.reports.verdict.limits import Limit


@pytest.mark.parametrize("name", BENCHES)
def test_an_interrupted_bench_leaves_nothing(name: str, tmp_path: Path) -> None:
    """Leave no folder, nor part of one, when Ctrl-C comes with the first progress."""

    def interrupt(label: str, count: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        load(name).run(tmp_path / "out", interrupt)
    assert list(tmp_path.iterdir()) == []


def test_a_broken_limit_fails_the_command(monkeypatch, touchstone) -> None:
    """End with exit 1 and the reason where a limit is broken, 0 where it holds."""
    row = Row("bench scaling", BROAD_PHASE, "reference", "balanced", nan, "scaling.exponent", 1.0, "1")
    for largest, wanted in ((0.9, 1), (1.1, 0)):
        monkeypatch.setattr(limits, "LIMITS", (Limit("scaling.exponent", largest, "as asked"),))
        monkeypatch.setattr(scaling, "run", lambda out, progress: table([judged(row, ())]))
        code, out, _ = touchstone("bench scaling --out o")
        assert code == wanted
        assert ("limit 0.900: as asked" in out) == (wanted == 1)


OTHER = "coal"


def test_exponents_of_power_laws_are_exact() -> None:
    """Give the exponent of times that follow one, a time per size, and the limit of the broad phase."""
    sizes = [100, 1000, 10_000]
    steep, flat = ([np.full(5, a * n**p) for n in sizes] for a, p in ((1e-7, 1.2), (1e-6, 0.4)))
    curves = [
        Curve(BROAD_PHASE, "pieces", "reference", "balanced", nan, sizes, steep),
        Curve(VERTICES, "vertices", OTHER, "default", nan, sizes, flat),
    ]
    rows = [judged(row, ()) for row in rows_of_curves(curves)]
    powers = {row.engine: row for row in rows if row.metric == "scaling.exponent"}
    assert powers["reference"].value == pytest.approx(1.2, abs=1e-12)
    assert (powers["reference"].limit, powers["reference"].verdict) == (1.1, "fail")
    assert powers[OTHER].value == pytest.approx(0.4, abs=1e-12)
    assert powers[OTHER].verdict == ""
    times = {row.subject: row.value for row in rows if row.metric == "scaling.time" and row.engine == OTHER}
    assert times == {f"{n} vertices": pytest.approx(1e-6 * n**0.4) for n in sizes}


def test_balls_at_rest_take_turns(shown, tmp_path: Path, monkeypatch) -> None:
    """Time every engine at every size, the reference at more; one that dies is a row with its reason."""
    monkeypatch.setattr("touchstone.reports.bench.scaling.installed", lambda name: name != "mujoco")
    amount = Amount(balls=(2, 4), more_balls=(6,), ball_turns=2, ball_frames=3)
    curves = balls_at_rest(amount, tmp_path, quietly, load_stepper)
    found = {curve.engine: curve for curve in curves}
    assert found["reference"].sizes == [2, 4, 6]
    assert found["bullet"].sizes == [2, 4]
    for name in ("reference", "bullet"):
        assert found[name].ended is None
        assert [len(times) for times in found[name].times] == [6] * len(found[name].sizes)
    assert found["dart"].ended == ("error", "died during 'play': exit code 7")
    assert found["mujoco"].ended[0] == "missing"
    rows = rows_of_curves(curves)
    assert {(r.engine, r.verdict) for r in rows if r.metric == "run"} == {
        ("dart", "error"),
        ("mujoco", "missing"),
    }
    # a fake's step sleeps a millisecond per ball at least
    for size, times in zip(found["reference"].sizes, found["reference"].times):
        assert (times >= 1e-3 * size).all()
    text = shown(scaling.report(table(rows)))
    assert "error: dart: died during 'play': exit code 7" in text


def test_balls_rest_on_the_floor_and_apart() -> None:
    """Touch the floor and nothing else, and stay where they are for a second."""
    scenario = resting_balls(10)
    assert len(scenario.bodies) == 11
    places = np.array([body.position for body in scenario.bodies[1:]])
    apart = np.linalg.norm(places[:, None] - places, axis=2) + np.eye(10)
    assert apart.min() > 0.15
    engine, settings = ReferenceEngine(), Settings("balanced", 1 / 60)
    warm_up(engine, scenario, settings)
    world = engine.build(scenario, settings)
    for _ in range(60):
        world.step()
    work = world.work()
    assert work["contacts"] >= 10
    assert work["unconverged"] == work["gave_up"] == work["lost"] == 0
    np.testing.assert_allclose(world._world.bodies["position"][1:], places, atol=1e-6)


SMALL = scaling.Amount(
    pieces=(70, 140),
    cloud_frames=3,
    balls=(2, 4),
    more_balls=(),
    ball_turns=1,
    ball_frames=2,
    vertices=(20, 40),
    hull_pairs=1,
    hull_frames=3,
    hull_turns=1,
)


def test_scaling_leaves_rows_and_picture(shown, monkeypatch, tmp_path: Path) -> None:
    """Run all three on tiny sizes: rows for each, exact exponents of the fakes, a picture, all progress."""
    monkeypatch.setattr(scaling, "SUBJECTS", (REFERENCE,))
    reported: list[int] = []
    rows = scaling.run(
        tmp_path / "out", lambda label, count: reported.append(count), SMALL, load_stepper, load_detector
    )
    assert set(rows.scenario) == {BROAD_PHASE, BALLS, VERTICES}
    powers = rows[rows.metric == "scaling.exponent"].set_index(["scenario", "engine"]).value
    assert set(powers.index) >= {(BROAD_PHASE, "reference"), (BALLS, "reference")}
    assert np.isfinite(powers).all()
    # the fake takes a microsecond a vertex
    assert powers[VERTICES, REFERENCE] == pytest.approx(1.0, abs=1e-12)
    assert (tmp_path / "out" / "scaling.png").read_bytes().startswith(b"\x89PNG")
    text = shown(scaling.report(rows))
    assert "neighbours each" in text
    assert "20 vertices 3 of 3 not converged" in text
    # dart dies when it first builds, and is asked no more
    assert sum(reported) == scaling.steps(SMALL)
