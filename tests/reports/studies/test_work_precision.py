"""The study `work-precision`: fronts, bands, orders, answers by brute force; what engines are known for."""

import numpy as np
import pandas as pd
import pytest

from touchstone.adapters.knobs import Choice
from touchstone.adapters.registry import installed, load, settings_of
from touchstone.reports.runner.cells import Cell
from touchstone.reports.runner.sweep import play_cell
from touchstone.reports.studies.work_precision.points import (
    COLUMNS,
    QUANTITIES,
    CellRun,
    band_of,
    changes,
    deficit,
    distance,
    errors_of,
    fronts,
    ladder_cells,
    measured_cells,
    outside,
    pareto,
    profiles_of,
    scenes,
    truth_cells,
    truth_of,
)
from touchstone.reports.studies.work_precision.study import (
    TIME,
    MeasuredSetting,
    StudyCells,
    answer_lines,
    cheapest,
    draw,
    settings_of_scene,
    tolerance,
)
from touchstone.scenarios.catalogue import catalogue

WAY = np.linspace(0, 1, 11)[:, None, None] * np.array([1.0, 0.0, 0.0])
"""One body that moves by a metre in ten frames: codes agree within 5 cm."""


def code(aside, change=0.0):
    """A code whose path is off to the side [m], and at twice the step by `change` more."""
    aside = np.array([0.0, aside, 0.0])
    return WAY + aside + [0.0, 0.0, change], WAY + aside


def banded(**codes):
    return band_of(codes, 10, 1e-3)


def test_the_outlier_is_outside_of_the_band_of_the_others():
    """Three of four agree; the reference has no say of its own."""
    band = banded(reference=code(0.1), dart=code(0.0), bullet=code(0.03), mujoco=code(0.01))
    assert band.codes == ("dart", "bullet", "mujoco")
    assert band.width == pytest.approx(0.03)
    assert band.outliers == pytest.approx({"reference": 0.07})
    assert band.words == "dart, bullet, mujoco agree to 30 mm; reference is 70 mm off"
    assert outside(WAY + [0.0, 0.02, 0.0], band.low, band.high, 10) == 0
    assert outside(WAY + [0.0, -0.3, 0.4], band.low, band.high, 10) == pytest.approx(0.5)


def test_a_code_that_has_not_converged_does_not_count():
    """Its place is no evidence, wherever it is."""
    band = banded(dart=code(0.0), bullet=code(0.0, change=0.06), mujoco=code(0.04))
    assert band.codes == ("dart", "mujoco")
    assert "bullet changes by 60 mm with half the step" in band.words


@pytest.mark.parametrize("places", [(0.0, 0.01, 0.3, 0.31), (0.0, 0.1, 0.2, 0.3)])
def test_codes_of_different_models_have_no_band(places):
    """Two against two, or each for itself: nothing says who is right."""
    band = banded(**{f"code{k}": code(place) for k, place in enumerate(places)})
    assert band.codes == ()
    assert band.words.startswith("codes converge to different models, more than 50 mm apart")


def test_of_equal_groups_that_share_a_code_the_narrowest_counts():
    """A chain: its ends do not agree."""
    band = banded(a=code(0.0), b=code(0.04), c=code(0.07))
    assert band.codes == ("b", "c")


def run_at(path, events):
    rows = [("events.meet", name, time, "") for name, time in events.items()]
    frame = pd.DataFrame(rows, columns=["metric", "subject", "value", "verdict"])
    return CellRun(frame, path, np.ones(len(path)))


def test_errors_are_distances_to_the_band():
    """Of positions and of times; an event that some code lacks is no truth; without a band there are none."""
    scene = catalogue()["ball_snip"]
    path = np.linspace(0, 1, scene.frame_count + 1)[:, None, None] * np.array([1.0, 0.0, 0.0])
    one = run_at(path, {"a": 1.0, "b": 2.0})
    other = run_at(path + [0.0, 0.02, 0.0], {"a": 1.1})
    truth = truth_of(scene, {"dart": (one, one), "mujoco": (other, other)}, None, ())
    late = errors_of(run_at(path + [0.0, 0.05, 0.0], {"a": 1.25}), truth)
    assert late == pytest.approx({"position": 0.03, "events": 0.15})
    assert errors_of(run_at(path, {}), truth) == {"position": 0.0, "events": np.inf}
    alone = truth_of(scene, {"dart": (one, one)}, None, ())
    assert errors_of(one, alone) == {}


RNG = np.random.default_rng(15)


def drawn(count):
    """Times and errors on a coarse grid, so that many are equal; some are infinite."""
    time = RNG.integers(1, 12, count) / 8.0
    error = RNG.integers(0, 12, count) / 8.0
    return time, np.where(RNG.random(count) < 0.1, np.inf, error)


@pytest.mark.parametrize("count", [0, 1, 2, 40])
@pytest.mark.parametrize("floor", [0.0, 0.3])
def test_a_front_is_what_nothing_dominates(count, floor):
    """Each point against every other."""
    for _ in range(50):
        time, error = drawn(count)
        clipped = np.maximum(error, floor)
        expected = [
            np.isfinite(e)
            and not any((t2 <= t and e2 < e) or (t2 < t and e2 <= e) for t2, e2 in zip(time, clipped))
            for t, e in zip(time, clipped)
        ]
        assert pareto(time, error, floor).tolist() == expected


def test_a_deficit_is_the_least_factor():
    """Each of their points against each of ours."""
    ours, theirs = RNG.random((7, 2)) + 0.1, RNG.random((9, 2)) + 0.1
    expected = [min(max(t / t2, max(e, 0.2) / max(e2, 0.2)) for t, e in ours) for t2, e2 in theirs]
    assert deficit(ours, theirs, 0.2) == pytest.approx(expected)
    assert deficit(ours, ours, 0.0).max() <= 1.0
    assert np.isinf(deficit(np.zeros((0, 2)), theirs, 0.0)).all()


def test_paths_are_compared_up_to_the_horizon():
    """The largest distance over bodies and frames, of the frames that both have."""
    one, other = RNG.random((9, 3, 3)), RNG.random((8, 3, 3))
    expected = max(np.linalg.norm(one[f, b] - other[f, b]) for f in range(5) for b in range(3))
    assert distance(one, other, 4) == pytest.approx(expected)
    assert distance(one, other, 99) == distance(one, other, 7)


def table(count=60, scene="fall"):
    """A table of random settings, some of which lack a quantity or a time."""
    rows = []
    for k in range(count):
        engine = ("reference", "dart", "bullet", "mujoco")[k % 4]
        time = np.nan if k % 17 == 16 else float(RNG.integers(1, 50)) / 100
        base = {"scenario": scene, "engine": engine, "profile": "one", "settings": f"k={k}", "dt": 1 / 60}
        base |= {"time": time, "time_low": time, "time_high": time}
        base |= {"front": False, "own_front": k % 3 == 0, "truth": "closed form"}
        base["reproduce"] = f"touchstone run {scene} --engine {engine} --set k={k}"
        for name in ("position", "overlap", "energy"):
            if k % 13 != 12 or name != "energy":
                rows.append({**base, "quantity": name, "error": float(RNG.integers(0, 20)) / 1000})
    return pd.DataFrame(rows, columns=list(COLUMNS))


def test_the_cheapest_is_that_of_brute_force():
    """1,000 random queries: the least time among all rows within every limit, or the least miss."""
    for _ in range(20):
        frame = table()
        settings = {}
        for row in frame.itertuples():
            known = settings.setdefault(row.settings, {"engine": row.engine, TIME: row.time / 60})
            known[row.quantity] = row.error
        known_settings = settings_of_scene(frame, 60)
        for _ in range(50):
            names = RNG.choice(["position", "overlap", "energy", TIME], RNG.integers(1, 5), replace=False)
            limits = {str(n): float(RNG.integers(0, 16)) / (6000 if n == TIME else 1000) for n in names}
            engine = str(RNG.choice(["", "mujoco"]))
            known = {
                k: s
                for k, s in settings.items()
                if limits.keys() <= s.keys() and s[TIME] == s[TIME] and engine in ("", s["engine"])
            }
            within = [s for s in known.values() if all(s[n] <= limit for n, limit in limits.items())]
            answer = cheapest(known_settings, limits, engine)
            assert answer is not None
            assert answer.met == bool(within)
            if within:
                times = sorted(s[TIME] for s in within)
                assert answer.best.time == times[0]
                assert (answer.runner_up.time if answer.runner_up else None) == (times[1:2] or [None])[0]
            else:
                excess = [
                    max((s[n] / v if v else np.inf * s[n] if s[n] else 0.0) for n, v in limits.items())
                    for s in known.values()
                ]
                assert answer.best.excess == min(excess) > 1


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [("1mm", "m", 1e-3), (" 2.5 cm", "m", 0.025), ("1e3m", "m", 1e3), ("1%", "1", 0.01), ("4ms", "s", 4e-3)],
)
def test_a_tolerance_has_a_unit(text, unit, value):
    """Numbers with units become SI."""
    assert tolerance(text, unit, "--x") == pytest.approx(value)


def test_fronts_name_the_point_that_is_not_dominated():
    """An engine that is faster, or more accurate, than all settings of the reference is named, with why."""
    rows = [
        ("reference", 1.0, 1e-3),
        ("reference", 4.0, 1e-6),
        ("dart", 2.0, 1e-2),
        ("bullet", 0.5, 1e-1),
        ("mujoco", 9.0, 1e-8),
    ]
    frame = pd.DataFrame(rows, columns=["engine", "time", "error"]).reindex(columns=list(COLUMNS))
    frame = frame.assign(scenario="fall", quantity="position", reproduce="touchstone run " + frame.engine)
    found = fronts(frame).set_index("engine")
    assert found.dominates.to_dict() == {"dart": True, "bullet": False, "mujoco": False}
    assert found.factor["bullet"] == pytest.approx(2.0)
    assert "2 times as fast" in found.why["bullet"]
    assert found.factor["mujoco"] == pytest.approx(100.0)
    assert "100 times smaller" in found.why["mujoco"]
    assert found["where"]["bullet"] == "bullet"


@pytest.mark.slow
def test_pictures_are_drawn_and_repeat(tmp_path):
    """One quantity a picture, with scenes, engines and missing truths by name; equal data, equal files."""
    frame = pd.concat([table(scene=f"scene {k}") for k in range(3)])
    frame = frame[(frame.scenario != "scene 2") | (frame.quantity != "position")]
    frame.attrs["bands"] = {"scene 2": "dart and bullet disagree"}
    names = [path.name for path in draw(frame, tmp_path)]
    quantities = [f"_{quantity}" for quantity in QUANTITIES if quantity in set(frame.quantity)]
    assert names == [f"work_precision{quantity}.{s}" for quantity in quantities for s in ("svg", "png")]
    shown = (tmp_path / "work_precision_position.svg").read_text()
    draw(frame, tmp_path)
    assert (tmp_path / "work_precision_position.svg").read_text() == shown
    texts = ("scene 0", "scene 1", "scene 2", *set(frame.engine))
    assert all(f">{text}<" in shown for text in texts)
    assert shown.count(">truth not converged<") == 1


def test_the_default_study_has_what_was_asked_for():
    """Gallery scenes and six probes, four engines, six steps, each engine's main knob; each cell once."""
    names = scenes()
    engines = ("reference", "dart", "bullet", "mujoco")
    cells = measured_cells(names, engines)
    assert len(cells) == len(set(cells))
    for engine in engines:
        mine = [cell for cell in cells if (cell.engine, cell.scenario) == (engine, "fall")]
        profile = mine[0].profile
        assert len({cell.dt for cell in mine if cell.profile == profile and not cell.changes}) >= 6
        changed = {cell.changes for cell in mine if cell.changes}
        assert len(changed) + len(profiles_of(engine)) >= 6 or engine == "reference"
        for one in changed:
            assert len({cell.dt for cell in mine if cell.changes == one}) >= 6
    assert {cell.dt for cell in truth_cells("fall")} == {1 / 1920, 1 / 3840, 1 / 240}
    assert set(QUANTITIES) == {"position", "overlap", "energy", "friction", "events"}


def test_the_longest_cells_are_measured_first():
    """Scenes stay together, the dearest first, each with its smallest steps first; none is lost."""
    asked = StudyCells(["fall", "ball_snip"], ("reference", "mujoco"))
    cells = asked.accuracy
    assert list(dict.fromkeys(cell.scenario for cell in cells)) == ["ball_snip", "fall"]
    for scene in ("fall", "ball_snip"):
        steps = [cell.dt for cell in cells if cell.scenario == scene]
        assert steps == sorted(steps)
    assert set(cells) == {*asked.truths, *asked.measured, *asked.ladder}


def test_the_ladder_changes_one_setting_at_a_time():
    """Every other value of a choice, and every number in which `accurate` differs; and two profiles as a
    whole."""
    table_of = settings_of("reference")
    ours, theirs = (table_of.values_of(profile) for profile in ("balanced", "accurate"))
    wanted = {name for name, s in table_of.items() if isinstance(s, Choice) or ours[name] != theirs[name]}
    assert {change.partition("=")[0] for change in changes()} == wanted
    cells = ladder_cells(["fall"])
    assert len(cells) == len(changes()) + 2
    assert [cell.profile for cell in cells[:2]] == ["paper", "accurate"]


def test_times_that_overlap_have_no_winner():
    """Settings whose times overlap that of the cheapest are named beside it; one that is apart is beaten."""

    def setting(k, times):
        times = (1e-6 * time for time in times)
        label = ("reference", "balanced", "", 1 / (60 * k))
        return MeasuredSetting(*label, *times, {"position": 0.0}, 0.0, "", f"play {k}")

    def answered(*times, limits):
        known = [setting(k, one) for k, one in enumerate(times, start=1)]
        return answer_lines(cheapest(known, limits), limits)

    limits = {"position": 1e-3}
    apart = answered((20, 19, 21), (30, 25, 40), limits=limits)
    assert apart[0] == "cheapest: reference balanced at 1/60 s: 20 us a frame (19 us to 21 us)"
    second = "reference balanced at 1/120 s: 30 us a frame (25 us to 40 us)"
    assert apart[2] == f"runner-up: {second}, 1.5 times the time"
    tied = answered((20, 19, 26), (30, 25, 40), (31, 27, 40), limits=limits)
    assert tied[0] == "cannot tell apart: reference balanced at 1/60 s: 20 us a frame (19 us to 26 us)"
    assert tied[2:] == [f"and: {second}", "again: play 1"]
    # a wide interval overlaps though the runner-up is apart
    wide = answered((20, 19, 21), (30, 25, 40), (50, 20, 90), limits=limits)
    starts = [line.partition(":")[0] for line in wide]
    assert starts == ["cannot tell apart", "  position 0 m of 1 mm", "and", "runner-up", "again"]
    assert "within noise" in answered((20, 19, 26), limits={TIME: 22e-6})[1]


def value(metric, scene, engine, dt, *changes):
    """Values of a metric by subject, of a cell played in this process."""
    if not installed(engine):
        pytest.skip(f"{engine} is not installed")
    cell = Cell(scene, engine, "recommended", dt, changes, options=(f"metrics={metric}",))
    done = play_cell(load(engine), cell)
    assert done.outcome == "done", done.rows
    return {row.subject: row.value for row in done.rows if row.metric == metric}


def test_mujoco_overlaps_less_with_a_shorter_time_constant():
    """A stack's overlap falls with solref, at one step, at least in proportion."""
    changes = [f"solref={seconds}" for seconds in (0.04, 0.02, 0.01, 0.005)]
    found = [value("overlap.max", "stack", "mujoco", 1 / 540, change)[""] for change in changes]
    assert found == sorted(found, reverse=True)
    assert found[0] > 8 * found[-1]


def test_no_step_mends_friction_along_darts_diagonal():
    """Boxes at three headings stop 30 % apart at any step; the solver of circular cones mends that."""
    at = [value("friction.heading", "slide", "dart", dt)[""] for dt in (1 / 240, 1 / 1020)]
    assert min(at) > 0.3
    assert value("friction.heading", "slide", "dart", 1 / 240, "solver=nsgs")[""] < 0.01
