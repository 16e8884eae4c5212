"""`bench frame` on frames of known length: exact ratios and factors, equal steps, verdicts, restarts kept."""

from dataclasses import replace
from math import prod
from pathlib import Path

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.recording import load
from touchstone.adapters.registry import ENGINES, registered
from touchstone.adapters.workers.children import Children, Job, Outcome
from touchstone.adapters.workers.process import last_core
from touchstone.reports.bench import frame
from touchstone.reports.bench.frame import CONTESTANTS, Contestant, Take
from touchstone.reports.bootstrap import RATIO, RATIOS
from touchstone.reports.progress import quietly
from touchstone.reports.results import Row, table
from touchstone.reports.run import ratios, time_limits
from touchstone.reports.run.ratios import FACTORS, contact_frames
from touchstone.scenarios.catalogue import catalogue

SCENE = catalogue()["ball_snip"]
POSED = ", drive=posed"
TIMES = {
    ("reference", "balanced"): 1e-5,
    ("reference", "paper"): 2e-5,
    ("reference", "equal-step"): 3e-5,
    ("dart", "recommended"): 4e-5,
    ("dart", "equal-step"): 2e-5,
    ("dart", f"equal-step{POSED}"): 1e-5,
    ("bullet", "recommended"): 1e-4,
    ("bullet", f"recommended{POSED}"): 5e-5,
    ("bullet", "equal-step"): 5e-5,
}
DART_AND_BULLET = ("dart", "recommended"), ("bullet", "recommended")


def taken(registry, times=TIMES, frames=180) -> dict[tuple[str, str, str], Take]:
    """Two restarts of frames of known length per column, with the contacts of a played scene."""
    base = registry.played("ball_snip", "reference")
    takes = {}
    for (engine, label), seconds in times.items():
        profile, _, drive = label.partition(", drive=")
        dt = ENGINES[engine].profiles[profile]
        settings = Settings(profile, dt, drive=drive or "native")
        first = replace(base, manifest=base.manifest.replace(f'"dt": {base.facts["dt"]}', f'"dt": {dt}'))
        assert first.facts["dt"] == dt
        sample = np.broadcast_to(seconds, frames)
        takes["ball_snip", engine, label] = Take(engine, settings, first, [sample, sample])
    return takes


@pytest.fixture(scope="module")
def rows(registry):
    """Rows of frames of known length."""
    return list(frame.rows_of_scene(SCENE, taken(registry)))


def test_ratios_are_exact(rows) -> None:
    """Give the reference over every engine in all statistics, exactly."""
    found = [row for row in rows if row.metric in RATIOS]
    assert {row.metric for row in found} == set(RATIOS)
    for row in found:
        engine, _, label = row.subject.partition(" ")
        assert row.value == pytest.approx(TIMES["reference", row.profile] / TIMES[engine, label], rel=1e-12)
        assert row.low == pytest.approx(row.high, rel=1e-12)
    assert {(r.profile, r.subject) for r in found} >= {
        *(("balanced", "dart recommended"), ("paper", f"bullet recommended{POSED}")),
        *(("equal-step", "bullet equal-step"), ("equal-step", f"dart equal-step{POSED}")),
    }


def test_equal_steps_are_equal(rows) -> None:
    """Compare `equal-step` only with `equal-step`, where all recordings, the reference's too, have one dt."""
    steps = {f"{row.engine} {row.profile}": row.dt for row in rows if row.metric == "time.frame"}
    ratios = [row for row in rows if row.metric.startswith(RATIO)]
    for row in ratios:
        assert ("equal-step" in row.subject) == (row.profile == "equal-step")
        if row.profile == "equal-step":
            assert row.dt == steps[row.subject] == steps["reference equal-step"] == 1 / 240
        else:
            assert row.dt == 1 / 60


def test_factors_multiply_to_the_ratio(rows) -> None:
    """Split a ratio into steps, dynamics and time per step: 1/3 * 1/2, 1/2 and 3 for DART."""
    found = {r.metric: r.value for r in rows if r.subject == "dart recommended" and r.profile == "balanced"}
    assert [found[name] for name in FACTORS] == pytest.approx([1 / 6, 0.5, 3.0])
    assert prod(found[name] for name in FACTORS) == pytest.approx(found[RATIO])
    none = {r.metric: r for r in rows if r.subject == "bullet recommended" and r.profile == "balanced"}
    assert none["ratio.dynamics"].reason == "no driven body"  # no posed column at the common step
    assert none["ratio.steps"].value * none["ratio.step"].value == pytest.approx(none[RATIO].value)


def test_only_frames_with_contact_are_judged(registry) -> None:
    """Take the mean over the frames in which either has a contact; all frames count beside it."""
    takes = taken(registry)
    contact = contact_frames(takes["ball_snip", "reference", "balanced"].first)
    assert 0 < contact.sum() < len(contact)
    slow = np.where(contact, 8e-5, 1e-6)
    takes["ball_snip", "reference", "balanced"].times = [slow, slow]
    found = {
        row.metric: row
        for row in frame.rows_of_scene(SCENE, takes)
        if (row.profile, row.subject) == ("balanced", "dart recommended")
    }
    assert found[RATIO].value == pytest.approx(2.0)
    assert found[f"{RATIO}.all"].value == pytest.approx(slow.mean() / 4e-5)
    assert f"; contact in {contact.sum()} of {len(contact)} frames; " in found[RATIO].reason


def limits(monkeypatch, measured: float) -> None:
    """Let `bench frame` have measured this ratio of `balanced` at own steps in `ball_snip`."""
    found = {("ball_snip", "balanced", "own steps", RATIO): measured}
    monkeypatch.setattr(time_limits, "_measured", lambda: found)


@pytest.mark.parametrize(
    ("measured", "limit", "verdict"),
    [(0.08, 0.12, "fail"), (0.14, 0.15, "fail"), (0.2, 0.3, "known"), (0.16, 0.24, "fail")],
)
def test_a_limit_is_at_most_half_above_what_was_measured(
    registry, monkeypatch, measured: float, limit: float, verdict: str
) -> None:
    """Fail at 0.25 over the fastest beyond 1.5 times the measured ratio; a missed target is known, with the
    stages of the reference."""
    limits(monkeypatch, measured)
    few = {key: TIMES[key] for key in (("reference", "balanced"), *DART_AND_BULLET)}
    rows = [row for row in frame.rows_of_scene(SCENE, taken(registry, few)) if row.metric == RATIO]
    (found,) = (row for row in rows if row.verdict)
    assert (found.subject, found.verdict) == ("dart recommended", verdict)
    assert found.limit == pytest.approx(limit)
    assert ("misses its target 0.15; with contact its time" in found.reason) == (verdict == "known")


CLOSE = "touchstone bench frame ball_snip decides"


@pytest.mark.parametrize(
    ("scene", "name", "value", "interval", "frames", "median", "verdict", "said"),
    [
        # within a quarter of its limit
        ("ball_snip", RATIO, 0.11, None, 100, np.inf, "pass", ""),
        ("ball_snip", RATIO, 0.13, None, 100, np.inf, "", CLOSE),
        ("ball_snip", RATIO, 0.18, None, 100, np.inf, "", CLOSE),
        ("ball_snip", RATIO, 0.19, None, 100, np.inf, "fail", ""),
        # a 99th percentile, however far it is from its limit
        ("ball_snip", f"{RATIO}.p99", 3.0, None, 100, np.inf, "", "no verdict from one run"),
        ("ball_snip", f"{RATIO}.p99", 3.0, None, np.inf, np.inf, "fail", ""),
        # the one frame of an impact
        ("fall", RATIO, 4.0, None, 1, np.inf, "", ""),
        ("fall", RATIO, 4.0, None, 9, np.inf, "", ""),
        ("fall", RATIO, 4.0, None, 10, np.inf, "fail", ""),
        ("fall", RATIO, 4.0, None, np.inf, np.inf, "fail", ""),
        # a mean that its median does not confirm: an interruption
        ("push_box", RATIO, 0.4, None, 240, 0.07, "", ""),
        ("push_box", RATIO, 0.4, None, 240, 0.35, "fail", ""),
        ("push_box", RATIO, 0.4, None, np.inf, 0.07, "fail", ""),
        # a limit inside the interval, of several restarts too
        ("push_box", RATIO, 0.9, (0.02, 1.1), 240, 0.9, "", "its interval includes"),
        ("push_box", RATIO, 0.9, (0.02, 1.1), np.inf, 0.9, "", "its interval includes"),
        ("push_box", RATIO, 0.9, (0.8, 1.1), 240, 0.9, "fail", ""),
        ("push_box", RATIO, 0.9, (0.8, 1.1), np.inf, 0.9, "fail", ""),
    ],
)
def test_one_run_decides_what_is_clear(
    monkeypatch, scene, name, value, interval, frames, median, verdict, said
) -> None:
    """Leave without verdict what several restarts may decide otherwise, and say so."""
    if scene == "ball_snip" and name == RATIO:
        limits(monkeypatch, 0.1)
    row = Row("run", scene, "reference", "balanced", 1 / 60, name, value, subject="mujoco recommended")
    row = replace(row, low=interval[0], high=interval[1]) if interval else row
    found = time_limits.judged_time("own steps", row, catalogue()[scene].tags, "", frames, median)
    assert found.verdict == verdict
    assert said in found.reason


@pytest.mark.parametrize(
    ("measured", "frames", "limit"),
    [(0.05, np.inf, 0.075), (0.05, 100, 0.15), (0.2, np.inf, 0.3), (0.2, 100, 0.3)],
)
def test_one_run_is_judged_by_the_target_where_that_is_met(monkeypatch, measured, frames, limit) -> None:
    """Take 1.5 times the measured ratio as the limit of a single run only where it misses the target."""
    limits(monkeypatch, measured)
    row = Row("run", "ball_snip", "reference", "balanced", 1 / 60, RATIO, 0.01, subject="dart recommended")
    row = time_limits.judged_time("own steps", row, ("gallery",), "", frames)
    assert (row.limit, row.verdict) == (pytest.approx(limit), "pass")


def test_one_run_is_confirmed_by_the_interval_of_its_medians(monkeypatch) -> None:
    """Leave a mean whose interval is beyond its limit without verdict where that of the median is not."""
    limits(monkeypatch, 0.1)
    contact = np.ones(180, dtype=bool)
    busy = np.repeat(np.where(np.arange(12) < 7, 5e-6, 5e-7), 15)[None]
    theirs = ratios.Timed("dart", "recommended", 1 / 1020, np.full((1, 180), 1e-5), contact)
    for mine, verdict in ((busy, ""), (np.full((1, 180), 3e-6), "fail")):
        ours = ratios.Timed("reference", "balanced", 1 / 60, mine, contact)
        row = next(r for r in ratios.ratio_rows("run", SCENE, [ours, theirs], True) if r.metric == RATIO)
        assert row.low > 0.15
        assert row.verdict == verdict


def test_limits_are_those_of_engines_beside_this_program(monkeypatch) -> None:
    """Judge the ratio to DART, with which the limit was measured, and only tell that to Rapier."""
    limits(monkeypatch, 0.1)
    own = ENGINES[registered("rapier")].profiles["recommended"]
    contact = np.ones(180, dtype=bool)
    columns = [
        ratios.Timed(engine, profile, dt, np.full((1, 180), seconds), contact)
        for engine, profile, dt, seconds in (
            ("reference", "balanced", 1 / 60, 1e-6),
            ("dart", "recommended", 1 / 1020, 1e-5),
            ("rapier", "recommended", own, 1e-6),
        )
    ]
    found = [row for row in ratios.ratio_rows("run", SCENE, columns, True) if row.metric == RATIO]
    assert {row.subject.split()[0]: row.verdict != "" for row in found} == {"dart": True, "rapier": False}


def test_overlap_fails_what_aims_at_a_ratio(monkeypatch, shown) -> None:
    """A larger overlap than the engine's fails `balanced` below its limit, and the table says so; `paper`,
    which aims at no ratio, is judged by its growth alone."""
    measured = {("ball_snip", profile, "own steps", RATIO): 0.1 for profile in ("balanced", "paper")}
    monkeypatch.setattr(time_limits, "_measured", lambda: measured)
    contact = np.ones(60, dtype=bool)

    def column(engine, profile, dt, seconds, overlap):
        row = Row("bench frame", "ball_snip", engine, profile, dt, "overlap.max", overlap)
        return ratios.Timed(engine, profile, dt, np.full((2, 60), seconds), contact, row)

    columns = [
        column("reference", "balanced", 1 / 60, 1e-6, 1e-3),
        column("reference", "paper", 1 / 60, 1e-6, 1e-3),
        column("dart", "recommended", 1 / 1020, 1e-5, 1e-4),
    ]
    found = ratios.ratio_rows("bench frame", SCENE, columns, one_run=False)
    verdicts = {row.profile: (row.verdict, row.value <= row.limit) for row in found if row.metric == RATIO}
    assert verdicts == {"balanced": ("fail", True), "paper": ("pass", True)}
    assert "fail 0.15, overlap larger" in shown([frame.report(table(found))[-2]])


def test_a_failed_column_says_why(registry, shown) -> None:
    """Show the reason of a column that failed, and all others."""
    takes = taken(registry)
    takes["ball_snip", "mujoco", "recommended"] = Take(
        "mujoco", Settings("recommended", 1 / 540), ended=("missing", "not installed")
    )
    text = shown(frame.report(table(frame.rows_of_scene(SCENE, takes))))
    assert "missing: mujoco: not installed" in text
    for word in ("bench frame: ball_snip", "bullet recommended posed", "dynamics", "over the fastest", "±"):
        assert word in text
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= 112


def test_every_restart_is_a_process_in_drawn_order(monkeypatch, tmp_path: Path, registry) -> None:
    """Start each engine again for each restart, on the last core, in an order that the seed draws."""
    started: list[tuple[str, int | None]] = []
    base = registry.played("ball_snip", "reference")
    reads: list[bool] = []

    class Fake(Children):
        def __init__(self, *args, **options) -> None:
            super().__init__(*args, **options)
            self.first = True

        def play(self, jobs, progress):
            (job,) = jobs
            if self.first:
                started.append((job.engine, self._core))
            self.first = False
            reads.append(job.reading)
            replace(base, time_frame=np.full(180, 1e-5)).save(job.recording)
            return [Outcome(job, "done")]

    monkeypatch.setattr(frame, "Children", Fake)
    pair = [Contestant(name, name) for name in ("reference", "mujoco")]
    orders = []
    for seed in (0, 0, 1):
        folder = tmp_path / str(len(orders))
        folder.mkdir()
        takes = frame.played(pair, [SCENE], 6, seed, folder, quietly)
        orders.append([name for name, _ in started])
        assert {core for _, core in started} == {last_core()}
        started.clear()
        assert {len(take.times) for take in takes.values()} == {6}
        assert sum(reads) == len(takes)
        reads.clear()
        assert len(list((folder / "recordings").iterdir())) == len(takes)
    assert orders[0] == orders[1] != orders[2]
    assert sorted(orders[0]) == ["mujoco"] * 6 + ["reference"] * 6
    assert orders[0] != [name for _ in range(6) for name in ("reference", "mujoco")]


def test_a_play_for_its_times_reads_no_state(tmp_path: Path) -> None:
    """The recording has a time for each frame, and the start in place of its state."""
    scene, path = catalogue()["fall"], tmp_path / "times.npz"
    job = Job("reference", scene, Settings("balanced", 1 / 60), path, tmp_path / "output.txt", reading=False)
    with Children(per_engine=True) as children:
        children.play([job], quietly)
    found = load(path)
    assert (found.time_frame > 0).all()
    assert (found.time_read == 0).all()
    assert (found.position == found.position[0]).all()


def test_columns_are_complete() -> None:
    """Play balanced, paper and equal steps of the reference, and engines with dynamic and kinematic links."""
    labels = {one.name: [s.label for s in one.settings(SCENE)] for one in CONTESTANTS}
    assert labels["reference"] == ["balanced", "paper", "equal-step"]
    assert labels["mujoco"] == [
        f"{name}{drive}" for name in ("recommended", "equal-step") for drive in ("", POSED)
    ]
    assert [s.label for s in CONTESTANTS[1].settings(catalogue()["fall"])] == ["recommended", "equal-step"]
    names = [scenario.name for scenario in frame.scenes()]
    assert {"ball_snip", "balls_box", "stack", "slide"} <= set(names)
    assert frame.steps([SCENE], 3) == 3 * SCENE.frame_count * 15


@pytest.mark.slow
def test_an_engine_is_as_fast_as_itself(tmp_path: Path) -> None:
    """Give a ratio of 1 within its interval in a duel of MuJoCo with itself, at the third try at most."""
    pytest.importorskip("mujoco")
    for attempt in range(3):
        row = frame.duel(
            tmp_path / str(attempt), quietly, catalogue()["stack"], "mujoco", restarts=5, seed=attempt
        )
        if row.low <= 1 <= row.high:
            break
    assert row.low <= 1 <= row.high
    assert 0.8 < row.value < 1.25
