"""What a solver left unresolved: metrics, their limits, and the one warning of a run."""

from dataclasses import replace

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import load
from touchstone.reports.metrics import METRICS, SOLVER_METRICS
from touchstone.reports.metrics.context import Context, NotMeasured
from touchstone.reports.metrics.solver import CAPS, DIGITS, Place, state_hash, state_hashed, worst_place
from touchstone.reports.results import Row
from touchstone.reports.studies.stability.play import hard_cell, play_all
from touchstone.reports.verdict import failings
from touchstone.reports.verdict.failings import Failing
from touchstone.reports.verdict.judge import judged
from touchstone.reports.verdict.rows import measured_of, warning
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.difficulty.family import hard_scene

NAMES = (
    *("contacts", "dropped_time", "gave_up", "lost", "parted_energy"),
    *("residual", "residual.body_a", "residual.body_b", "unconverged"),
)
QUIET = {"residual.body_a": -1.0, "residual.body_b": -1.0}
FRAMES = 6


@pytest.fixture
def context(lab, recordings):
    """Context of three bodies over six frames with counters given per frame: {frame: {name: value}}."""

    def build(reported=None, contacts=(), names=NAMES):
        bodies = (lab.ground(), lab.ball("one"), lab.ball("two", (0.0, 1.0, 1.0)))
        scenario = lab.scene(*bodies, duration=FRAMES / 60)
        work = np.array([[QUIET.get(name, 0.0) for name in names] for _ in range(FRAMES)])
        for frame, counters in (reported or {}).items():
            for name, value in counters.items():
                work[frame - 1, names.index(name)] = value
        rows = recordings.contacts(*contacts)
        recording = recordings.recording(scenario, work_names=np.array(names), work=work, contacts=rows)
        return Context(recording, scenario)

    return build


def rows_of(context, profile="balanced", engine="reference"):
    """The judged rows of the solver's metrics."""
    base = Row("run", "scene", engine, profile, 1 / 60, "run")
    found = measured_of(base, context, SOLVER_METRICS)
    return [judged(row, ()) for row in found if row.metric in SOLVER_METRICS]


def warned(context, profile="balanced", engine="reference"):
    """The warning of a run."""
    return warning(Row("run", "scene", engine, profile, 1 / 60, "run"), context)


UNRESOLVED = {
    2: {"residual": 3e-5, "residual.body_a": 1, "residual.body_b": 2, "unconverged": 2},
    4: {"residual": 1e-9, "residual.body_a": 0, "residual.body_b": 1, "dropped_time": 0.002},
    5: {"parted_energy": 0.25, "gave_up": 1},
    6: {"parted_energy": 0.5, "dropped_time": 0.001},
}
TOUCH = {"time": 5.5 / 60, "body_a": 0, "body_b": 2, "distance": -1e-3}
SHALLOW = {"time": 5.5 / 60, "body_a": 0, "body_b": 1, "distance": 0.0}


def test_sizes_add_up_and_residuals_do_not(context):
    """Take the largest residual and the sums of time, energy and caps, each with its worst frame and pair."""
    reported = context(UNRESOLVED, (SHALLOW, TOUCH))
    found = {name: METRICS[name].measure(reported)[""] for name in SOLVER_METRICS}
    assert {name: value.value for name, value in found.items()} == pytest.approx(
        {
            "solver.residual": 3e-5,
            "solver.dropped_time": 0.003,
            "solver.parted_energy": 0.75,
            "solver.caps": 3,
        }
    )
    assert {name: value.reason for name, value in found.items()} == {
        "solver.residual": "most in frame 2 (one, two)",
        "solver.dropped_time": "most in frame 4 (ground, one)",
        # the deepest contact of the frame is what was parted
        "solver.parted_energy": "most in frame 6 (ground, two)",
        "solver.caps": "gave_up 1, unconverged 2; most in frame 2 (one, two)",
    }


def test_a_new_cap_is_counted_and_shown(context):
    """A counter of a single cap is part of the sum and of the remark, whichever engine adds it."""
    reported = context({3: {"cap.posture_qp": 4, "lost": 1}}, names=(*NAMES, "cap.posture_qp"))
    (found,) = METRICS["solver.caps"].measure(reported).values()
    assert (found.value, found.reason) == (5, "lost 1, cap.posture_qp 4; most in frame 3")
    # a cap that leaves nothing behind warns nobody
    assert warned(reported) is None


def test_a_resolved_run_is_zero_and_says_nothing(context):
    """Give plain zeros that meet their limits, and no warning."""
    reported = context()
    assert [METRICS[name].measure(reported) for name in SOLVER_METRICS] == [{"": 0.0}] * 4
    rows = rows_of(reported)
    assert [row.verdict for row in rows] == ["pass"] * 3 + [""]
    assert warned(reported) is None


def test_energy_taken_away_by_parting_counts_too(context):
    """Judge parting that lowers bodies by its size."""
    rows = {row.metric: row for row in rows_of(context({3: {"parted_energy": -0.1}}))}
    assert rows["solver.parted_energy"].verdict == "fail"


def test_other_engines_do_not_tell(context):
    """Measure nothing where the engine counts nothing of it, and warn of nothing."""
    reported = context(names=("contacts",))
    for name in SOLVER_METRICS:
        with pytest.raises(NotMeasured, match="does not report"):
            METRICS[name].measure(reported)
    rows = rows_of(reported, engine="mujoco", profile="recommended")
    assert [row.verdict for row in rows] == ["skipped"] * 4
    assert warned(reported, "recommended", "mujoco") is None


def test_one_line_names_scene_profile_frame_and_pair(context):
    """Tell all that breaks a limit in one line: how large it is, in which frame, between which bodies."""
    reported = context({2: UNRESOLVED[2] | {"unconverged": 0}})
    line = warned(reported)
    assert line == "warning: reference balanced scene: contact solve left 3e-05 m/s in frame 2 (one, two)"
    reported = context(UNRESOLVED, (SHALLOW, TOUCH))
    assert warned(reported) == (
        "warning: reference balanced scene: contact solve left 3e-05 m/s in frame 2 (one, two); "
        "0.003 s were not simulated, most of it in frame 4 (ground, one); "
        "parting overlap added 0.75 J, most of it in frame 6 (ground, two)"
    )


def test_known_failings_are_warned_of(context, monkeypatch):
    """Warn of what is known to fail as well: the numbers of the run are no better for it."""
    known = Failing(
        engine="reference", profile="balanced", scenario="scene", metric="solver.dropped_time",
        largest=0.02, cause="reference.heap",
    )  # fmt: skip
    monkeypatch.setattr(failings, "known", lambda: {known.key: known})
    reported = context({2: {"dropped_time": 0.01}})
    assert [row.verdict for row in rows_of(reported)] == ["pass", "known", "pass", ""]
    assert "0.01 s were not simulated, most of it in frame 2" in str(warned(reported))


def test_a_frame_without_contacts_has_no_pair(context):
    """Name the frame alone where no contact tells a pair."""
    assert worst_place(context({3: {"gave_up": 1}}), *CAPS) == Place(3, None)
    assert str(Place(3, None)) == "frame 3"


@pytest.mark.parametrize("profile", ["balanced", "accurate"])
@pytest.mark.parametrize("name", SOLVER_METRICS[:3])
def test_every_scene_has_a_limit(profile, name):
    """Judge each of these metrics in every scene of the catalogue, in both profiles that claim exactness."""
    for scenario in catalogue().values():
        row = Row("run", scenario.name, "reference", profile, 1 / 60, name, 1.0)
        assert judged(row, scenario.tags).verdict in ("fail", "known")


def test_the_papers_own_way_is_no_failing(context):
    """Let `paper` hold contacts in turn: 1e-4 m/s, parting and caps are its method, dropped time is not."""
    reported = context({1: {"residual": 9e-5, "parted_energy": 1.0, "unconverged": 5}})
    assert warned(reported, "paper") is None
    reported = context(
        {1: {"residual": 2e-4, "residual.body_a": 0, "residual.body_b": 1, "dropped_time": 1e-3}}
    )
    assert [r.metric for r in rows_of(reported, "paper") if r.verdict == "fail"] == list(SOLVER_METRICS[:2])


def test_sizes_are_no_work(context):
    """Keep sizes and bodies out of the table of counts."""
    assert set(METRICS["work"].measure(context(UNRESOLVED))) == {"contacts", *CAPS}


SCENE = "hard_mass_stack_10"
SETTINGS = Settings("balanced", 1 / 60)


@pytest.fixture(scope="module")
def recording():
    """A stack of two cubes, by the reference."""
    return record(load("reference"), hard_scene(SCENE)[0], SETTINGS)


def test_a_bit_changes_the_hash(recording):
    """One unit in the last place of one number of one frame gives another hash, a clock does not."""
    position = recording.position.copy()
    position[-1, 1, 2] = np.nextafter(position[-1, 1, 2], np.inf)
    assert state_hash(replace(recording, position=position)) != state_hash(recording)
    assert state_hash(replace(recording, time_frame=recording.time_frame + 1)) == state_hash(recording)


@pytest.mark.spawned
def test_fresh_processes_do_not_change_the_hash(recording, tmp_path):
    """A process of its own, whatever it played before: the same hash as in this process."""
    others = [hard_cell(f"hard_{n}", "reference", "balanced", 1 / 60) for n in ("mass_stack_1", "wedge_90")]
    cell = hard_cell(SCENE, "reference", "balanced", 1 / 60)
    played = play_all([*others, cell], tmp_path / "runs", lambda label, count: None, jobs=1)
    assert played[cell].state_hash == state_hash(recording)


def test_the_metric_holds_the_digits(recording):
    """A float holds the first digits exactly, and the remark all of them."""

    class Context:
        pass

    context = Context()
    context.recording = recording
    found = state_hashed(context)[""]
    assert found.reason == state_hash(recording)
    assert f"{int(found.value):0{DIGITS}x}" == found.reason[:DIGITS]
