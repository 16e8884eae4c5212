"""Where two columns are farthest apart, and ratios of their times with intervals."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.workers.children import Children, Job
from touchstone.reports.bench import repeatability
from touchstone.reports.bootstrap import exponent, median_interval, restart_ratio, time_ratio
from touchstone.reports.metrics.context import Context
from touchstone.reports.results import Row, table
from touchstone.reports.run.farthest_apart import THRESHOLD, apart_rows, measured_horizon
from touchstone.reports.views.tables import apart_table, headlines
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.files.write import scene_toml
from touchstone.scenarios.scenario import PairCoefficients, Scenario, Tracker
from touchstone.scenarios.solids import block

BALANCED, ACCURATE, MUJOCO = ("reference", "balanced"), ("reference", "accurate"), ("mujoco", "recommended")
PAPER = ("reference", "paper")


@pytest.fixture
def apart(lab, recordings):
    """Rows of one ball of 30 frames whose columns follow given heights over the frames."""
    scenario = lab.scene(lab.ball(), duration=0.5)

    def rows(horizon=lambda: np.nan, columns=(BALANCED, ACCURATE, MUJOCO), **heights):
        played = {}
        for column, height in zip(columns, heights.values()):
            still = recordings.recording(scenario)
            position = still.position.copy()
            position[: len(height), 0, 2] += height
            played[column] = Context(replace(still, position=position), scenario)
        return apart_rows(scenario, played, horizon)

    return rows


def test_names_pair_moment_and_onset(apart):
    """A ball that leaves at a speed of 0.6 m/s is 0.3 m away after 0.5 s, and above 1 mm after one frame."""
    (row,) = apart(still=np.zeros(31), leaves=np.arange(31) * 0.01, close=np.full(31, 4e-4))
    assert (row.engine, row.metric, row.subject, row.unit) == ("all", "position.spread", "ball", "m")
    assert row.value == pytest.approx(0.3)
    assert row.reason == (
        "reference balanced and reference accurate at 0.5 s; above 1 mm from 0.0167 s on; "
        "400 um without reference accurate"
    )
    assert headlines([row]) == [f"farthest apart: ball, 300 mm: {row.reason}"]


def test_paper_counts_only_beside_one_other(apart):
    """The pipeline that guarantees nothing does not lead the line of two others; beside one it does."""
    heights = {"one": np.zeros(31), "two": np.full(31, 0.02), "paper": np.full(31, 3.0)}
    (row,) = apart(columns=(BALANCED, MUJOCO, PAPER), **heights)
    assert (row.value, "paper" in row.reason) == (pytest.approx(0.02), False)
    (row,) = apart(columns=(BALANCED, PAPER), one=np.zeros(31), paper=np.full(31, 3.0))
    assert (row.value, "reference paper" in row.reason) == (pytest.approx(3.0), True)


def test_says_that_columns_stay_together(apart):
    """Below the threshold there is no outlier, and nothing is measured twice: no horizon is asked for. No
    body is named where paths are equal; one column has no row and no line."""

    def never():
        raise AssertionError

    (row,) = apart(never, one=np.zeros(31), other=np.full(31, THRESHOLD / 2), third=np.zeros(31))
    assert row.value == pytest.approx(THRESHOLD / 2)
    assert row.reason.endswith("; never above 1 mm")
    equal = apart(one=np.zeros(31), other=np.zeros(31))
    assert headlines(equal) == ["farthest apart: no body, all paths are equal"]
    assert apart(one=np.zeros(31)) == headlines([]) == []


def test_compares_up_to_the_horizon(apart):
    """What columns do after the horizon does not count; the row says how much it is."""
    late = np.where(np.arange(31) > 15, 5.0, 0.02)
    horizon, row = apart(lambda: 15 / 60, one=np.zeros(31), other=late)
    assert (horizon.metric, horizon.value, horizon.unit) == ("position.horizon", 0.25, "s")
    assert row.value == pytest.approx(0.02)
    assert row.reason.endswith("; until 0.25 s, when 1 um at the start are 100 um (the horizon); 5 m later")


def test_a_column_that_ends_early_is_compared_until_then(lab, recordings):
    """Recordings of 10 and 31 frames are compared over 10."""
    scenario = lab.scene(lab.ball(), duration=0.5)
    whole = recordings.recording(scenario)
    ended = replace(
        whole,
        **{n: getattr(whole, n)[:10] for n in ("time", "position", "orientation")},
        contacts=whole.contacts,
    )
    moved = replace(whole, position=whole.position + np.linspace(0, 1, 31)[:, None, None] * [0, 0, 1.0])
    played = {BALANCED: Context(ended, scenario), MUJOCO: Context(moved, scenario)}
    (row,) = apart_rows(scenario, played, lambda: np.nan)
    assert row.value == pytest.approx(9 / 30)


def test_a_table_counts_what_it_does_not_show(apart):
    """Of ten bodies the eight that are farthest apart, and the number of the others."""
    (row,) = apart(one=np.zeros(31), other=np.full(31, 0.01))
    lines = apart_table([replace(row, subject=f"b{k}", value=0.01 * k) for k in range(10)])
    assert [line[1] for line in lines] == [*(f"b{k}" for k in range(9, 1, -1)), "and 2 more"]
    assert lines[-1][2] == "at most 20 mm"


def test_the_horizon_of_a_fall_is_its_end_and_of_collisions_before(tmp_path):
    """A fall keeps a perturbation as it is; a break of fifteen balls multiplies it at every collision."""
    files, settings = (tmp_path / "a.npz", tmp_path / "a.txt"), Settings("balanced", 1 / 60)
    with Children(together=True) as children:
        for scenario, amplifies in ((catalogue()["fall"], False), (catalogue()["break_15"], True)):
            job = Job("reference", scenario, settings, *files)
            (outcome,) = children.play([job], lambda *_: None)
            assert outcome.status == "done", outcome.reason
            horizon = measured_horizon(scenario, job, children, lambda *_: None)
            assert (horizon < scenario.duration) == amplifies
            assert horizon > 0


def squeeze():
    """Two pads squeeze a cube of 0.1 kg with 20 N."""
    cube = block("cube", "wood", (0.02, 0.02, 0.02), 0.1, (0.0, 0.0, 0.5))
    pads, trackers, still = [], [], ((1.0, 0.0, 0.0, 0.0),) * 3
    for name, side in (("left", -1.0), ("right", 1.0)):
        pads.append(block(name, "pad", (0.01, 0.03, 0.06), 0.5, kind="driven"))
        path = tuple((side * x, 0.0, 0.5) for x in (0.0305, 0.02, 0.02))
        servo = {"interpolation": "linear", "stiffness": 2000.0, "damping": 63.25}
        trackers.append(Tracker(name, (), (0.0, 0.1, 2.0), path, still, ((),) * 3, **servo))
    pairs = tuple(PairCoefficients(other, "pad", 0.0, 0.7) for other in ("wood", "pad"))
    return Scenario("squeeze", "two pads squeeze", (), (cube, *pads), 2.0, pairs, trackers=tuple(trackers))


@pytest.mark.engines
def test_the_first_line_of_an_own_scene_names_the_farthest_body(touchstone, tmp_path):
    """The paper's pipeline drops a cube by metres that `balanced` holds; no limit judges it."""
    (tmp_path / "squeeze.toml").write_text(scene_toml(squeeze()))
    code, out, err = touchstone(
        "run squeeze.toml --engine reference --profile balanced --profile paper --out run"
    )
    assert code == 0, err
    first = out.splitlines()[0]
    assert first.startswith("farthest apart: cube, "), first
    assert "m: reference balanced and reference paper at 2 s; above 1 mm from 0.0167 s on" in first
    report = (tmp_path / "run" / "report.md").read_text()
    assert "| squeeze | cube |" in report.partition("## Differences")[0]
    assert "position." not in report.partition("### Spread of the events")[2].partition("###")[0]
    assert "farthest apart: cube" in (tmp_path / "run" / "report.html").read_text()
    code, _, err = touchstone("judge run --out again --quiet")
    assert code == 0, err
    code, out, _ = touchstone("compare run again --metric 'position.*'")
    assert (code, "0 worse" in out) == (0, True), out
    limit = "[[limits]]\nmetric = 'position.spread'\nsubject = 'cube'\nlargest = 0.01\n"
    (tmp_path / "limits.toml").write_text(limit)
    code, _, err = touchstone("judge run --out judged --limits limits.toml --quiet")
    assert (code, "position.spread" in err) == (1, True), err


def noisy(seed, median, spikes=0.0, frames=180):
    """Times with noise that scatters by a tenth, and spikes on a share of the frames."""
    rng = np.random.default_rng(seed)
    times = median * np.exp(0.1 * rng.normal(size=frames))
    return times * np.where(rng.random(frames) < spikes, 50.0, 1.0)


def test_a_constant_ratio_is_exact():
    """Times that are a fixed share of others have that ratio with no width, whatever noise both share; frames
    that one did not play are left out, whichever is longer."""
    theirs, more = noisy(1, 1e-4, spikes=0.5), np.ones(300)
    pairs = ((theirs, theirs), (np.append(theirs, more), theirs), (theirs, np.append(theirs, more)))
    for one, other in pairs:
        ratio = time_ratio(one / 4, other)
        assert (ratio.value, ratio.low, ratio.high) == pytest.approx((0.25, 0.25, 0.25), rel=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_the_interval_holds_value_and_truth(seed):
    """The interval holds the ratio of medians and the truth and is a few percent wide, spikes or not."""
    ratio = time_ratio(noisy(seed, 2e-5, spikes=0.05), noisy(seed + 100, 1e-4))
    assert ratio.low <= ratio.value <= ratio.high
    # the median of 180 frames that scatter by a tenth is good to 1 %: 95 % of seeds, these were drawn once
    assert ratio.low * 0.99 < 0.2 < ratio.high * 1.01
    assert ratio.high / ratio.low < 1.15


def test_the_interval_is_reproducible():
    """The same times give the same interval to the bit; another seed another one."""
    ours, theirs = noisy(1, 2e-5), noisy(2, 1e-4)
    assert time_ratio(ours, theirs) == time_ratio(ours.copy(), theirs.copy())
    assert time_ratio(ours, theirs, seed=1) != time_ratio(ours, theirs)
    assert time_ratio(ours, theirs, seed=1).value == time_ratio(ours, theirs).value


SIZES = (100, 320, 1000, 3200, 10_000)


@pytest.mark.parametrize("power", [0.0, 0.5, 1.0, 5 / 3, 2.0])
def test_the_exponent_of_a_power_law_is_exact(power):
    """Times that follow a power law have its exponent, with no width, in any unit of time."""
    for unit in (1e-9, 3.0):
        times = [np.full(7, unit * size**power) for size in SIZES]
        assert exponent(SIZES, times) == pytest.approx((power,) * 3, abs=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_the_exponent_stands_noise_and_spikes(seed):
    """Noise of a tenth and spikes move the exponent by less than 0.02; the interval holds the truth."""
    # a median of 60 is good to 1.6 %, and the slope over two decades to 0.005: four of its deviations
    times = [size**1.1 * noisy(10 * seed + k, 1e-6, 0.05, 60) for k, size in enumerate(SIZES)]
    value, low, high = exponent(SIZES, times)
    assert low <= value <= high
    assert value == pytest.approx(1.1, abs=0.02)
    assert low - 0.01 < 1.1 < high + 0.01


def test_the_interval_of_a_median():
    """The interval holds the median, is the same each time, and has no width without noise."""
    sample = noisy(6, 1.0)
    value, low, high = median_interval(sample)
    assert low < value == np.median(sample) < high
    assert median_interval(sample) == (value, low, high)
    assert median_interval(np.ones(5)) == (1.0, 1.0, 1.0)


def restarted(rng, median, restarts=5, frames=120):
    """Times (r, f) of a scene: a course that every restart repeats, a speed per restart, noise and spikes."""
    course = 1 + 0.5 * np.sin(np.arange(frames) / 9)
    speeds = np.exp(0.03 * rng.normal(size=(restarts, 1)))
    noise = np.exp(0.05 * rng.normal(size=(restarts, frames)))
    spikes = np.where(rng.random((restarts, frames)) < 0.02, 20.0, 1.0)
    return median * course * speeds * noise * spikes


MEASURES = {"mean": lambda t: t.mean(axis=-1), "p99": lambda t: np.percentile(t, 99, axis=-1)}


@pytest.mark.parametrize("name", MEASURES)
def test_a_duel_with_oneself_is_1_within_its_interval(name):
    """Cover 1 in some 95 % of duels of equal engines, whatever spikes and speeds the restarts have."""
    covered, widths = 0, []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        ratio = restart_ratio(restarted(rng, 1e-4), restarted(rng, 1e-4), MEASURES[name], np.arange(120))
        covered += ratio.low <= 1 <= ratio.high
        widths.append(ratio.high / ratio.low)
    assert covered >= 176
    assert np.median(widths) < 1.2


def test_a_restart_that_is_disturbed_does_not_count():
    """Take each frame's median over restarts: one restart of ten times the time changes nothing."""
    rng = np.random.default_rng(0)
    times = np.tile(np.exp(0.1 * rng.normal(size=60)), (5, 1))
    slow = times.copy()
    slow[2] *= 10
    ratio = restart_ratio(slow, times, MEASURES["mean"], np.arange(60))
    assert ratio.value == pytest.approx(1.0, rel=1e-12)


def test_only_chosen_frames_count():
    """Leave frames without contact out of the ratio."""
    ours, theirs = np.ones((3, 50)), np.full((3, 50), 4.0)
    ours[:, :40] = 100.0
    ratio = restart_ratio(ours, theirs, MEASURES["mean"], np.arange(40, 50))
    assert (ratio.value, ratio.low, ratio.high) == pytest.approx((0.25,) * 3)


def test_overlapping_intervals_of_two_runs_are_counted(tmp_path, capsys):
    """Match rows of two tables by scene, column, metric and subject; print the share that overlaps."""
    base = Row("bench frame", "fall", "reference", "balanced", 1 / 60, "ratio.time", 0.5, subject="dart r")
    one = [replace(base, low=0.4, high=0.6), replace(base, scenario="slide", low=0.1, high=0.2)]
    two = [replace(base, low=0.55, high=0.7), replace(base, scenario="slide", low=0.21, high=0.3)]
    paths = [str(tmp_path / name) for name in ("one.csv", "two.csv")]
    for rows, path in zip((one, [*two, replace(base, scenario="stack", low=0, high=1)]), paths):
        table(rows).to_csv(path, index=False)
    repeatability.main(paths)
    assert capsys.readouterr().out == "ratio.time: 1 of 2 intervals overlap, 50.0 %\n"


def test_stored_runs_of_two_days_are_compared(tmp_path):
    """Keep the intervals alone; compare the last run with the last one of an earlier day."""
    base = Row("bench frame", "fall", "reference", "balanced", 1 / 60, "ratio.time", 0.5, subject="dart r")
    facts = {"commit": "0123456789abcdef", "machine": {"processor": "one processor"}}

    def kept(day, low, high):
        rows = [replace(base, low=low, high=high), replace(base, metric="overlap.max")]
        repeatability.store(table(rows), {**facts, "day": day}, tmp_path)

    kept("2026-01-02", 0.4, 0.6)
    assert repeatability.stored_lines(tmp_path) == [
        "One run is stored (2026-01-02-0123456789ab); none of an earlier day."
    ]
    kept("2026-01-03", 0.7, 0.8)
    assert len(pd.read_csv(tmp_path / "2026-01-03-0123456789ab.csv")) == 1
    assert repeatability.stored_lines(tmp_path) == [
        "2026-01-02-0123456789ab and 2026-01-03-0123456789ab, one processor:",
        "- ratio.time: 0 of 1 intervals overlap, 0.0 %",
    ]
