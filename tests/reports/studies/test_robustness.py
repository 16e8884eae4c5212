"""The study robustness: engines that misbehave in one way each fall into their class, whatever the scene."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scripted_engines import Engine

from touchstone.adapters.contract import Settings
from touchstone.reports.results import table
from touchstone.reports.studies import robustness as study
from touchstone.reports.studies.robustness import (
    ALL,
    SeededTask,
    assess,
    line,
    picture,
    report,
    run,
    short,
    table_of_runs,
)
from touchstone.reports.verdict.figures import available_energy
from touchstone.reports.verdict.outcomes import EXACT, lowest_points
from touchstone.scenarios.random_scenes import random_scene
from touchstone.scenarios.scenario import BodyJoint, PairCoefficients, Scenario
from touchstone.scenarios.solids import ball, block, slab

SETTINGS = Settings("balanced", 1 / 60)
TOWER = next(seed for seed in range(100) if random_scene(seed).tags[1] == "tower")
"""A seed of a tower, which stands in exact contact."""
FREE = next(seed for seed in range(100) if random_scene(seed).tags[1] == "free")
CLASSES = {
    "rests": "ok",
    "silent": "ok",
    "unsupported": "skipped",
    "announces": "error",
    "not finite": "non-finite",
    "explodes": "exploded",
    "tunnels": "tunnelled",
    "drops a millimetre": "overlap",
    "gains a little": "rise",
    "stalls": "residual",
}


def test_energy_at_the_start_is_that_of_the_closed_form():
    """Add m v^2 / 2, w.I w / 2 and m g times the height over the lowest point of all."""
    spin, speed = (0.0, 0.0, 30.0), (0.0, 2.0, 0.0)
    bodies = (
        slab("floor", "wood"),
        ball("ball", "wood", 0.05, 2.0, (0.0, 0.0, 0.25), speed, spin),
        block("box", "wood", (0.1, 0.1, 0.03), 3.0, (1.0, 0.0, 0.04)),
    )
    scene = Scenario("s", "", (), bodies, 0.5, (PairCoefficients("wood", "wood", 0.0, 0.0),))
    kinetic = 2.0 * 4 / 2 + 0.4 * 2.0 * 0.05**2 * 900 / 2
    # the box's lower face is at 0.01 m
    assert available_energy(scene, {1: 0.05, 2: 0.03}) == pytest.approx(
        kinetic + 9.81 * (2.0 * 0.24 + 3.0 * 0.03), rel=1e-14
    )
    assert available_energy(replace(scene, effects=()), {1: 0.05, 2: 0.03}) == pytest.approx(
        kinetic, rel=1e-14
    )


def test_bodies_that_joints_hold_may_fall_by_the_length_of_their_joints():
    """A chain of two links of 1 and 2 kg, hung up at a height, with a bent spring of 8 N m/rad."""
    links = ball("one", "wood", 0.01, 1.0, (0.05, 0.0, 0.5)), ball("two", "wood", 0.01, 2.0, (0.15, 0.0, 0.5))
    joints = (
        BodyJoint("hook", "hinge", "", "one", (0.0, 0.0, 0.5), stiffness=8.0, target=0.5),
        BodyJoint("link", "ball", "one", "two", (0.1, 0.0, 0.5)),
    )
    scene = Scenario(
        "s", "", (), links, 0.5, (PairCoefficients("wood", "wood", 0.0, 0.0),), body_joints=joints
    )
    assert available_energy(scene, {}) == pytest.approx(1.0 + 9.81 * (1.0 * 0.05 + 2.0 * 0.15), rel=1e-14)
    # a slider without limits holds nothing: the lower of its bodies is the bottom
    free = replace(scene, body_joints=(replace(joints[0], type="slider", stiffness=0.0), joints[1]))
    assert available_energy(free, {}) == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize("name", CLASSES)
def test_runs_fall_into_their_class(name):
    """Tell runs apart that end early, gain energy, overlap, pass, stall or go well."""
    scene = random_scene(TOWER)
    found = assess(Engine(name), scene, SETTINGS, EXACT)
    assert found.outcome == CLASSES[name]
    if name == "rests":
        assert (found.frames, found.rise, found.overlap < 1e-8) == (scene.frame_count, 0.0, True)
        assert found.residual == 1e-12
    if name == "stalls":
        assert found.dropped_time == pytest.approx(2e-3 * scene.frame_count)
    if name == "gains a little":
        moving = sum(body.mass for body in scene.bodies if body.kind == "simulated")
        energy = available_energy(scene, lowest_points(scene))
        assert found.rise == pytest.approx(1.5 * moving * 1e-4 / energy, rel=1e-12)
    if name == "silent":
        assert (found.residuals, np.isnan(found.residual)) == ((), True)
    if name == "announces":
        assert (found.reason.startswith("announces: lost its way"), found.frames) == (True, 2)


def test_momentum_of_isolated_scenes_is_judged():
    """Find the momentum that vanishes where bodies stop in the air, but not where none has to be kept."""
    assert assess(Engine("stops"), random_scene(FREE), SETTINGS, EXACT).outcome == "momentum"
    assert np.isnan(assess(Engine("rests"), random_scene(TOWER), SETTINGS, EXACT).momentum)


@pytest.mark.slow
def test_a_study_outlives_those_that_hang_or_die(tmp_path):
    """Count a hang and a death, replace the process, and play the others."""
    names = ("rests", "hangs", "dies", "rests", "unsupported", "explodes")
    asked = [SeededTask(name, SETTINGS, TOWER + k) for k, name in enumerate(names)]
    reported = []
    frame = run(
        [], asked, tmp_path / "out", lambda label, steps: reported.append(steps), Engine, patience=8.0
    )
    assert sum(reported) == len(asked)
    runs = pd.read_csv(tmp_path / "out" / "runs.csv")
    assert runs.engine.tolist() == list(names)
    assert runs.outcome.tolist()[1:3] == ["hang", "error"]
    assert runs.outcome.tolist()[4] == "skipped"
    counts = frame[(frame.scenario == ALL) & (frame.engine == "dies")].set_index("metric").value
    assert counts["robustness.error"] == 1
    assert (tmp_path / "out" / "robustness.png").read_bytes().startswith(b"\x89PNG")


def test_limits_hold_for_the_reference_alone():
    """Judge the counts and spreads over all kinds of the reference; list the worst with their lines."""
    found = [assess(Engine(n), random_scene(TOWER), SETTINGS, EXACT) for n in ("explodes", "rests", "stalls")]
    tasks_of = {e: [SeededTask(e, SETTINGS, TOWER)] * 3 for e in ("reference", "dart")}
    for engine, asked in tasks_of.items():
        rows = [study.judged(row, ()) for row in study.rows_of_runs(list(zip(asked, found)))]
        verdicts = {row.metric: row.verdict for row in rows if row.scenario == ALL}
        broken = {metric for metric, verdict in verdicts.items() if verdict == "fail"}
        expected = {"robustness.exploded", "robustness.rise.max", "robustness.rise.p99"}
        assert broken == (expected | {"robustness.residual.p995"} if engine == "reference" else set())
        assert {row.verdict for row in rows if row.scenario == "tower"} == {""}
        worst = [row for row in rows if row.metric == "run"]
        assert [row.subject for row in worst] == ["exploded", "residual"]
        dropped = [row.value for row in rows if row.metric == "robustness.dropped_time.max"]
        assert dropped[0] == max(one.dropped_time for one in found) > 0
        assert (worst[0].reproduce, worst[0].reason[:8]) == (line(asked[0]), "diverged")


def test_a_line_names_all_that_a_run_was():
    """Repeat engine, profile, seed, kind and perturbation."""
    task = SeededTask("dart", Settings("accurate", 1e-3), 7, "heap", 1e-16)
    assert line(task) == (
        "touchstone study robustness --scenes 1 --seed 7 --engine dart --profile accurate "
        "--kind heap --perturbation 1e-16"
    )
    assert task.scenario.name == random_scene(7).name
    moved = np.array([body.position for body in task.scenario.bodies])
    there = np.array([body.position for body in random_scene(7, "heap").bodies])
    assert 0 < np.abs(moved - there).max() < 1e-15


def test_what_is_shown(shown):
    """Print a table per column with the classes that occur, the limits that broke and the worst runs."""
    asked = [SeededTask("reference", SETTINGS, TOWER)] * 2
    found = [assess(Engine(name), random_scene(TOWER), SETTINGS, EXACT) for name in ("explodes", "rests")]
    rows = [study.judged(row, ()) for row in study.rows_of_runs(list(zip(asked, found)))]
    text = shown(report(table(rows)), 120)
    assert "robustness: reference, balanced" in text
    assert "limit broken: reference balanced: robustness.exploded" in text
    assert f"--seed {TOWER} --engine reference" in text
    assert (short(3.26e-5), short(0.0), short(2e300)) == ("3e-5", "0", "2e300")


def test_the_picture_is_drawn_of_few_or_none(tmp_path):
    """Draw runs without residual, without rise, of two engines, and no runs at all."""
    asked = [SeededTask("reference", SETTINGS, TOWER)] * 2
    found = [assess(Engine(name), random_scene(TOWER), SETTINGS, EXACT) for name in ("silent", "not finite")]
    runs = table_of_runs(list(zip(asked, found)))
    engines = runs.assign(engine=["reference", "dart"], rise=[1e-9, np.inf])
    for k, part in enumerate((runs, engines, runs[:0])):
        picture(part, tmp_path / f"{k}.png")
        assert (tmp_path / f"{k}.png").read_bytes().startswith(b"\x89PNG")
