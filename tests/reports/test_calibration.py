"""The study calibration: estimators by closed forms, scenes that are what they say, complete rows."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from touchstone.adapters.registry import ACCURATE, ENGINES, Entry
from touchstone.reports.progress import quietly
from touchstone.reports.results import COLUMNS
from touchstone.reports.studies.calibration import (
    HEIGHT,
    NOTES,
    SHAPES,
    SLIDE_TIME,
    G,
    Probe,
    Requested,
    failure_lines,
    friction_of,
    grids,
    lowest_speed,
    page,
    report,
    restitution_of,
    run,
    scene,
    subject_of,
    tasks,
)

TINY = Requested(
    pairs=("sphere-box", "box-box"),
    restitutions=(0.0, 0.5),
    speeds=(0.1, 2.0),
    frictions=(0.3,),
    headings=(0.0, 45.0),
    slips=(1e-3,),
    ladder=(0.2, 1.0),
    steps=(60,),
    drop_phases=(0.0, 0.5),
)
COLUMNS_RUN = (("reference", "balanced"), ("absent", "recommended"))
PER_PAIR = {
    # of one column: two restitutions at two speeds, achieved and bias; one friction at two headings
    "restitution.achieved": 4,
    "friction.achieved": 2,
    "friction.bias": 2,
    "gap.rest": 1,
    "restitution.bias.max": 1,
    "friction.bias.max": 1,
}
ROUNDING = 1e-9
"""Of an arc through a few hundred steps."""


def bounce(e: float, speed: float, dt: float, level: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Height and velocity of a body that meets `level` at 0.05 s with a speed and returns e of it."""
    t = np.arange(0, 0.3, dt) - 0.05
    v = np.where(t < 0, -speed - G * t, e * speed - G * t)
    z = level + np.where(t < 0, -speed * t, e * speed * t) - G * t * t / 2
    return z, v


@pytest.mark.parametrize("dt", [1 / 60, 1 / 1000])
@pytest.mark.parametrize("speed", [1.0, 5.0])
@pytest.mark.parametrize("e", [0.3, 0.5, 1.0])
def test_restitution_of_a_parabola(e: float, speed: float, dt: float) -> None:
    """Find e from two exact arcs, wherever between two samples they meet, above 0 too."""
    for level in (0.0, 1e-3):
        z, v = bounce(e, speed, dt, level)
        assert restitution_of(z, v, G, dt, level) == pytest.approx(e, abs=ROUNDING)


def test_restitution_at_the_ends() -> None:
    """Give 0 to a body that rests or only slows down, and NaN to one that never lands."""
    dt = 1e-2
    z, v = bounce(0.0, 1.0, dt)
    landed = np.where(np.arange(len(z)) < 6, z, 0.0), np.where(np.arange(len(z)) < 6, v, 0.0)
    assert restitution_of(*landed, G, dt) == 0.0
    # braked before it lands, then at rest
    braked = landed[1].copy()
    braked[4:6] /= 2
    assert restitution_of(landed[0], braked, G, dt) == 0.0
    assert np.isnan(restitution_of(1 - G * (dt * np.arange(9)) ** 2 / 2, -G * dt * np.arange(9), G, dt))


@pytest.mark.parametrize("heading", [0.0, 0.4, 2.0])
def test_friction_of_an_even_deceleration(heading: float) -> None:
    """Find mu of a block, and of a ball whose slip falls 7/2 as fast as its speed."""
    mu, dt, along = 0.3, 1e-3, np.array((np.cos(heading), np.sin(heading)))
    t = np.arange(0, 0.3, dt)
    velocity = np.outer(1.0 - mu * G * t, along)
    assert friction_of(velocity, velocity, G, dt) == pytest.approx(mu, abs=ROUNDING)
    slip = np.outer(np.maximum(0.0, 1.0 - 3.5 * mu * G * t), along)
    assert friction_of(velocity, slip, G, dt) == pytest.approx(mu, abs=ROUNDING)
    assert np.isnan(friction_of(velocity[:50], velocity[:50], G, dt))


def test_lowest_speed() -> None:
    """Name the speed from which on all bounce, though a slower one may; NaN where the fastest does not."""
    speeds = np.array([0.1, 0.2, 0.3, 0.4])
    assert lowest_speed(speeds, np.array([0.0, 1.0, 0.0, 0.9])) == 0.4
    assert lowest_speed(speeds, np.array([1.0, 1.0, 1.0, 0.3])) == 0.1
    assert np.isnan(lowest_speed(speeds, np.array([1.0, 1.0, 1.0, np.nan])))


@pytest.mark.parametrize("dt", [1 / 60, 1 / 1020, 1 / 4000])
@pytest.mark.parametrize("pair", SHAPES)
def test_bodies_arrive_as_asked(pair: str, dt: float) -> None:
    """Meet the floor with the speed asked for, at the phase of a step where there is time, and apart."""
    probe = Probe(pair, "restitution", 0.5, (0.1, 2.0), (0.25, 0.75))
    made = scene(probe, dt)
    assert 1 / made.frame_rate == pytest.approx(dt, rel=1e-9)
    floor, *bodies = made.bodies
    assert floor.position[2] + floor.pieces[0].shape.half_extents[2] == 0.0
    for body, (speed, phase) in zip(bodies, ((v, p) for v in probe.speeds for p in probe.phases)):
        gap, fall = body.position[2] - HEIGHT, -body.linear_velocity[2]
        arrival = np.sqrt(fall**2 + 2 * G * gap)
        assert arrival == pytest.approx(speed, rel=1e-12)
        steps = (arrival - fall) / G / dt
        assert steps % 1 == pytest.approx(phase, abs=1e-6) or steps < 2 + phase
    places = np.array([body.position[:2] for body in bodies])
    apart = np.linalg.norm(places[:, None] - places, axis=2)
    assert apart[apart > 0].min() > 8 * HEIGHT


def test_slides_turn_with_their_heading() -> None:
    """Start every slide at the speed that friction stops in SLIDE_TIME, the body turned along."""
    probe = Probe("box-box", "friction", 0.4, headings=(0.0, 22.5, 45.0))
    for body, heading in zip(scene(probe, 1 / 240).bodies[1:], probe.headings):
        along = np.deg2rad(heading)
        wanted = 0.4 * G * SLIDE_TIME * np.array((np.cos(along), np.sin(along), 0.0))
        np.testing.assert_allclose(body.linear_velocity, wanted, atol=1e-14)
        assert 2 * np.arccos(body.orientation[0]) == pytest.approx(along, abs=1e-7)
        assert body.position[2] == HEIGHT


def test_the_whole_grid_is_played() -> None:
    """Play every restitution, friction and rung under every profile, and other steps under the first."""
    grid = Requested()
    found = tasks((("bullet", "recommended"), ("bullet", "accurate")), grid)
    jobs = [(task.settings, task.probe) for task in found]
    asked = {(s.profile, p.pair, p.kind, p.requested) for s, p in jobs if p.kind not in ("drop", "lowest")}
    wanted = {("restitution", e) for e in grid.restitutions} | {("friction", mu) for mu in grid.frictions}
    slow = {("slow", mu) for mu in grid.frictions}
    assert asked == {
        (profile, pair, *one)
        for profile in ("recommended", "accurate")
        for pair in SHAPES
        for one in (wanted if pair == "sphere-box" else wanted | slow)
    }
    assert min(grid.speeds) == min(grid.ladder) == 0.02
    assert min(grid.slips) == 1e-3
    rungs = [
        v for s, p in jobs if s.profile == "accurate" and set(p.speeds) <= set(grid.ladder) for v in p.speeds
    ]
    assert rungs == list(grid.ladder)
    assert [round(1 / s.dt) for s, p in jobs if p.kind == "drop"] == list(grid.steps)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> tuple[pd.DataFrame, Path]:
    """A run of the reference and of an engine that is not installed, and its folder."""
    folder = tmp_path_factory.mktemp("calibration")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(ENGINES, "absent", Entry("no.such:Thing", "no_such_package", {"recommended": 1 / 60}))
        return run(COLUMNS_RUN, folder / "one", quietly, TINY), folder / "one"


def test_rows_are_complete(results) -> None:
    """Hold every value asked for, once, beside its bias, and the bias is the difference."""
    frame = results[0]
    assert tuple(frame.columns) == COLUMNS
    assert set(frame.study) == {"calibration"}
    mine = frame[frame.engine == "reference"]
    assert not mine.duplicated(["scenario", "profile", "dt", "metric", "subject"]).any()
    for pair in TINY.pairs:
        counts = mine[mine.scenario == pair].metric.value_counts()
        assert {name: counts[name] for name in PER_PAIR} == PER_PAIR
    assert set(mine[mine.metric == "restitution.lowest"].scenario) == {"sphere-box"}
    drop = mine[mine.metric == "restitution.drop"].iloc[0]
    # the top lies between two frames, off by g (h / 2)^2 / 2 of 0.5 m: half of it shows
    assert (drop.value, drop.low, drop.high) == pytest.approx((1, 1, 1), abs=3.5e-4)
    for pair, e in ((pair, e) for pair in TINY.pairs for e in TINY.restitutions):
        rows = mine[(mine.scenario == pair) & (mine.subject == subject_of("restitution", e, 2.0))]
        by_metric = rows.set_index("metric")
        achieved, bias = by_metric.value["restitution.achieved"], by_metric.value["restitution.bias"]
        assert bias == pytest.approx(achieved - e, abs=1e-15)
        assert by_metric.reason["restitution.achieved"] == f"asked {e:g}"


def test_the_reference_obeys_its_laws(results) -> None:
    """Return what is asked from 2 m/s on, and slide as Coulomb says along any heading."""
    frame = results[0][results[0].engine == "reference"]
    largest = frame[frame.metric == "restitution.bias.max"]
    slow = frame[frame.metric == "friction.slow.max"]
    assert slow.value.max() < 1e-5
    assert set(slow.verdict) == {"pass"}
    assert largest.value.max() < 1e-4  # 1e-6 m of touch gap over a hop of 5 cm
    assert frame[frame.metric == "friction.bias"].value.abs().max() < 1e-6
    assert set(largest.verdict) == {"pass"}


def test_short_hops_are_skipped(results) -> None:
    """Skip what is over within two steps, with what was asked."""
    frame = results[0]
    short = frame[(frame.metric == "restitution.achieved") & (frame.subject == "e=0.5 v=0.1")]
    assert set(short.verdict) == {"skipped"}
    assert set(short.reason) == {"asked 0.5; a hop of less than 2 steps"}


def test_files_are_written(results) -> None:
    """Leave table, picture, page, manifest and the engines' output, and no other folder."""
    frame, folder = results
    pd.testing.assert_frame_equal(pd.read_parquet(folder / "results.parquet"), frame)
    assert (folder / "calibration.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "report.md").read_text() == page(frame)
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["grid"]["speeds"] == list(TINY.speeds)
    assert manifest["engines"]["reference"]["version"]
    assert {path.name for path in folder.iterdir()} == {
        *("results.parquet", "results.csv", "calibration.png", "report.md", "manifest.json", "output")
    }
    assert [path.name for path in folder.parent.iterdir()] == ["one"]


def test_an_engine_that_fails_is_one_row(tmp_path: Path) -> None:
    """Say of an engine that breaks how it did; the others are measured."""
    frame = run((("mujoco", ACCURATE),), tmp_path / "out", quietly, TINY, loader=str)  # type: ignore[arg-type]
    rows = frame[frame.metric == "run"]
    assert rows[["engine", "profile", "verdict"]].to_numpy().tolist() == [["mujoco", ACCURATE, "error"]]
    assert rows.reason.iloc[0].startswith("AttributeError")
    assert failure_lines(frame) == [f"error: mujoco accurate: {rows.reason.iloc[0]}"]


def test_a_probe_that_is_refused_is_one_row(tmp_path: Path) -> None:
    """Tell which probe an engine cannot represent, and measure the others."""
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    few = {"frictions": (), "headings": (), "ladder": (), "steps": ()}
    grid = replace(TINY, pairs=("sphere-box",), restitutions=(0.01, 0.5), speeds=(1.0,), **few)
    frame = run((("mujoco", ACCURATE),), tmp_path / "out", quietly, grid)
    refused = frame[frame.metric == "run"]
    assert refused[["verdict", "subject"]].to_numpy().tolist() == [["skipped", "restitution 0.01"]]
    achieved = frame[frame.metric == "restitution.achieved"]
    assert achieved.subject.tolist() == ["e=0.5 v=1"]


def test_the_terminal_shows_asked_beside_achieved(results, shown) -> None:
    """Print a row per column under the values asked for, and the reason of a skipped engine."""
    frame = results[0]
    text = shown(report(frame))
    missing = "missing: absent recommended: not installed (no module 'no_such_package')"
    for said in ("reference balanced 1/60 s", "asked", missing, *NOTES):
        assert said in text
    assert "…" not in text
    restitution, friction, slow, drops = grids(frame)
    assert slow.heads[1:] == ["bounce\n0.1", "slide\n0.001", "slide\nbias"]
    assert slow.rows[0][1:] == ["-", "1.000", "0.000"]
    assert restitution.heads[1:3] == ["asked\n0", "asked\n0.5"]
    assert friction.heads[1:3] == ["sphere\n0°", "sphere\n45°"]
    assert friction.rows[0][1:5] == ["1.000"] * 4
    assert drops.rows[0][1] == "1.000 (1.000 to 1.000)"
