"""The loop, its clock and its books, on a world whose every number is known."""

import json
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.adapters import recorder as module
from touchstone.adapters.contract import CONTACT_CAPACITY, AdapterError, Manifest, Settings, State
from touchstone.adapters.recorder import (
    CROSSINGS,
    WARM_UP_FRAMES,
    Player,
    frame_seconds,
    record,
    substeps,
    undisturbed,
    warm_up,
)
from touchstone.adapters.recording import RunEnded
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.scenario import Body, Box, Joint, PairCoefficients, Piece, Scenario, Tracker

FRAME_RATE, SUBSTEPS, FRAMES = 10, 4, 5
DT = 1 / (FRAME_RATE * SUBSTEPS)
ROUNDING = 1e-12
"""A few dozen sums of numbers near 1, relative."""
HALF = 0.5**0.5
DRIVE, STEP, READ, CROSS = 1.0, 10.0, 100.0, 1000.0
"""What the calls of the fake world cost on the fake clock [s]."""
CENTER = np.array([0.3, 0.0, 0.1])
"""Centre of mass of the root in its own frame, which stands turned a quarter about z [m]."""
ARM = np.array([0.0, 0.3, 0.1])
"""The same in the world."""


class FakeWorld:
    """Constant accelerations under a constant drive; one contact per step from the second on."""

    def __init__(self, scenario, clock):
        self.scenario, self.clock, self.steps, self.log, self.closed = scenario, clock, 0, [], False
        self.contact, self.left = {}, {}
        self.diverge_at = None

    def drive(self, step):
        self.clock.now += DRIVE
        self.log.append(("drive", step))

    def step(self):
        self.clock.now += STEP
        self.steps += 1
        self.log.append(("step", self.steps - 1))

    def read(self, state):
        self.clock.now += READ
        t = self.steps * DT
        state.orientation[0] = (HALF, 0.0, 0.0, HALF)
        # origin accelerates at (2, 0, 0), spin at (0, 0, 4): the centre's velocity has both
        state.angular_velocity[0] = (0.0, 0.0, 4.0 * t)
        state.linear_velocity[0] = np.array([2.0 * t, 0.0, 0.0]) + np.cross([0.0, 0.0, 4.0 * t], ARM)
        state.position[0] = (t * t, 0.0, 0.0)
        state.joint_rate[0] = 3.0 * t
        state.force[0], state.torque[0], state.hinge_torque[0] = (5.0, 7.0, 0.0), (0.0, 1.0, 6.0), 0.5
        if self.steps == self.diverge_at:
            state.position[1, 2] = np.inf
        if self.steps >= 2:
            point = np.array([1.0, 0.0, 0.0])
            state.add_contact(
                1, 0, point, np.array([0.0, 0.0, 1.0]), -0.01, np.array([0.0, 0.0, float(self.steps)])
            )
            for name, value in self.contact.items():
                state.contacts[state.contact_count - 1][name] = value

    def describe(self):
        return Manifest("fake", "1", "only", DT, {}, {}, ())

    def cross(self):
        self.clock.now += CROSS

    def stage_seconds(self):
        self.log.append(("stages", self.steps))
        return {"b": 0.25 * self.steps, "a": 1.0}

    def work(self):
        counted = {"pairs": float(self.steps)} if self.steps % 2 else {"contacts": 1.0}
        return counted | self.left.get(self.steps, {})

    def close(self):
        self.closed = True


class FakeEngine:
    """Builds FakeWorlds and remembers them."""

    def __init__(self, scenario, clock):
        self.worlds, self.clock, self.diverge_at, self.contact, self.left = [], clock, None, {}, {}

    def build(self, scenario, settings):
        world = FakeWorld(scenario, self.clock)
        world.diverge_at, world.contact, world.left = self.diverge_at, self.contact, self.left
        self.worlds.append(world)
        return world


class Clock:
    """A clock that goes only when told."""

    now = 0.0


@pytest.fixture
def clock(monkeypatch):
    """The clock of the loop, in the test's hands."""
    clock = Clock()
    monkeypatch.setattr(module, "process_time", lambda: clock.now)
    monkeypatch.setattr(module, "perf_counter", lambda: clock.now)
    return clock


@pytest.fixture
def scenario():
    """A driven root with one hinge and a box beside them, half a second at ten frames a second."""
    inertia = ((0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.1))
    box = (Piece("box", Box((0.1, 0.1, 0.1))),)
    return Scenario(
        "fake",
        "a fake",
        (),
        (
            Body("root", "driven", "m", box, mass=1.0, inertia=inertia, center_of_mass=tuple(CENTER)),
            Body("box", "simulated", "m", box, mass=1.0, inertia=inertia),
            Body("tip", "driven", "m", (), mass=1.0, inertia=inertia),
        ),
        FRAMES / FRAME_RATE,
        (PairCoefficients("m", "m", 0.0, 0.0),),
        joints=(Joint("hinge", "root", "tip", (0.1, 0.0, 0.0), (0.0, 1.0, 0.0)),),
        trackers=(
            Tracker("root", ("hinge",), (0.0, 1.0), ((0.0,) * 3,) * 2, ((1.0, 0, 0, 0),) * 2, ((0.0,),) * 2),
        ),
        frame_rate=FRAME_RATE,
    )


@pytest.fixture
def engine(scenario, clock):
    """The fake engine on the fake clock."""
    return FakeEngine(scenario, clock)


@pytest.fixture
def settings():
    """Four native steps a frame."""
    return Settings("only", DT, effects=PLANNED)


def test_every_frame_is_kept_at_its_time(engine, scenario, settings):
    """Frames are the initial state and that of every fourth step, at the times of the display."""
    kept = record(engine, scenario, settings)
    t = np.arange(FRAMES + 1) / FRAME_RATE
    assert kept.time == pytest.approx(t, rel=ROUNDING)
    assert kept.position[:, 0, 0] == pytest.approx(t**2, rel=ROUNDING)
    assert kept.joint_rate[:, 0] == pytest.approx(3 * t, rel=ROUNDING)
    assert kept.facts["engine"] == "fake"
    assert json.loads(kept.scenario)["name"] == "fake"


def test_a_player_stops_when_its_time_is_up(engine, scenario, settings):
    """Play a frame at least, stop after the one in which the time runs out, and go on where it stopped."""
    player = module.Player(engine.build(scenario, settings), scenario, settings)
    frame = SUBSTEPS * (STEP + DRIVE + READ)
    assert player.play(FRAMES, 0.0) == FRAMES - 1
    assert player.play(FRAMES - 1, 1.5 * frame) == FRAMES - 3
    assert player.play(FRAMES - 3, 100 * frame) == 0
    assert player.frames_played == FRAMES
    assert player.seconds_played == pytest.approx(FRAMES * SUBSTEPS * STEP, rel=ROUNDING)


def test_steps_are_driven_in_order_and_numbered(engine, scenario, settings):
    """Each step is driven with its own number just before it is made; stages are asked once a frame."""
    record(engine, scenario, settings)
    log = engine.worlds[0].log
    calls = [entry for entry in log if entry[0] != "stages"]
    assert calls == [(what, k) for k in range(FRAMES * SUBSTEPS) for what in ("drive", "step")]
    # the first answer is thrown away: it is of the time before the first frame
    assert [entry[1] for entry in log if entry[0] == "stages"] == [SUBSTEPS * k for k in range(FRAMES + 1)]
    assert engine.worlds[0].closed


def test_the_clock_separates_step_drive_read_and_crossing(engine, scenario, settings):
    """A frame's time is its native steps alone; drive, read and crossing have columns of their own."""
    kept = record(engine, scenario, settings)
    assert kept.time_frame.tolist() == [SUBSTEPS * STEP] * FRAMES
    assert kept.time_drive.tolist() == [SUBSTEPS * DRIVE] * FRAMES
    assert kept.time_read.tolist() == [SUBSTEPS * READ] * FRAMES
    assert kept.time_crossing.tolist() == [CROSS] * CROSSINGS


def test_counters_are_summed_and_stages_kept_by_name(engine, scenario, settings):
    """Counters add up over the steps of a frame, absent ones count zero; stages stand in columns by name."""
    kept = record(engine, scenario, settings)
    assert kept.work_names.tolist() == ["contacts", "pairs"]
    odd = [sum(n for n in range(4 * f + 1, 4 * f + 5) if n % 2) for f in range(FRAMES)]
    assert kept.work.tolist() == [[2.0, float(pairs)] for pairs in odd]
    assert kept.stage_names.tolist() == ["a", "b"]
    assert kept.stage_seconds.tolist() == [[1.0, float(f + 1)] for f in range(FRAMES)]


def test_of_residuals_the_largest_of_a_frame_is_kept(engine, scenario, settings):
    """Keep the largest residual of a frame's steps with its bodies, in any order; other counters add."""

    def left(size, a, b):
        return {"residual": size, "residual.body_a": a, "residual.body_b": b, "dropped_time": 0.5}

    engine.left = {1: left(1e-3, 1, 2), 2: left(2e-3, 0, 1), 3: left(0.0, -1, -1), 5: left(0.0, -1, -1)}
    kept = record(engine, scenario, settings)
    reported = dict(zip(kept.work_names.tolist(), kept.work.T.tolist()))
    assert reported["residual"][:2] == [2e-3, 0.0]
    assert reported["residual.body_a"][:2] == [0.0, -1.0]
    assert reported["residual.body_b"][:2] == [1.0, -1.0]
    assert reported["dropped_time"][:2] == [1.5, 0.5]


def test_driver_work_of_a_constant_drive(engine, scenario, settings):
    """Work is force times the way of the origin, torque times the turn and hinge torque times its angle."""
    kept = record(engine, scenario, settings)
    t = kept.time
    # way t^2 along x, turn 2 t^2 about z, hinge 3/2 t^2; rates are linear, so the trapezoid is exact
    assert kept.driver_work == pytest.approx((5.0 * 1 + 6.0 * 2 + 0.5 * 1.5) * t**2, rel=ROUNDING)


def test_contacts_carry_the_start_of_their_step(engine, scenario, settings):
    """A contact without a time is at the start of its step, in order, turned to its earlier body."""
    rows = record(engine, scenario, settings).contacts
    steps = np.arange(1, FRAMES * SUBSTEPS)
    assert rows["time"] == pytest.approx(steps * DT, rel=ROUNDING)
    assert set(zip(rows["body_a"], rows["body_b"])) == {(0, 1)}
    assert (rows["normal"] == [0.0, 0.0, -1.0]).all()
    assert rows["impulse"][:, 2].tolist() == (-(steps + 1.0)).tolist()
    assert (rows["distance"] == -0.01).all()


def test_contact_velocities_are_of_the_surface(engine, scenario, settings):
    """Velocities at the contact are filled from the states round the step, with the arm of its start."""
    rows = record(engine, scenario, settings).contacts
    for row, (start, end) in zip(rows, pairwise(np.arange(1, FRAMES * SUBSTEPS + 1) * DT)):
        for moment, t in (("before", start), ("after", end)):
            center = np.array([start**2, 0.0, 0.0]) + ARM
            omega = np.array([0.0, 0.0, 4.0 * t])
            velocity = [2.0 * t, 0.0, 0.0] + np.cross(omega, ARM) + np.cross(omega, row["position"] - center)
            assert row[f"velocity_a_{moment}"] == pytest.approx(velocity, rel=ROUNDING, abs=ROUNDING)
            assert (row[f"velocity_b_{moment}"] == 0).all()


def test_what_an_engine_knows_of_a_contact_is_kept(engine, scenario, settings):
    """An engine's own moment of impact is counted from the step's start; its own velocities stay."""
    engine.contact = {"time": 0.01, "velocity_a_before": (7.0, 8.0, 9.0)}
    rows = record(engine, scenario, settings).contacts
    assert rows["time"] == pytest.approx(np.arange(1, FRAMES * SUBSTEPS) * DT + 0.01, rel=ROUNDING)
    assert (rows["velocity_a_before"] == [7.0, 8.0, 9.0]).all()
    assert np.isfinite(rows["velocity_a_after"]).all()


def test_playing_in_slices_is_playing_at_once(engine, scenario, settings):
    """Frames played one by one leave the recording that playing them together leaves."""
    whole = record(engine, scenario, settings)
    player = Player(engine.build(scenario, settings), scenario, settings)
    for count in (1, 3, 1):
        player.play(count)
    assert player.frames_played == FRAMES
    sliced = player.recording()
    for name in ("position", "driver_work", "contacts", "work", "time_frame", "stage_seconds"):
        assert getattr(whole, name).tobytes() == getattr(sliced, name).tobytes(), name


def test_a_diverged_state_is_an_error_with_its_time(engine, scenario, settings):
    """A position that is not finite ends the run with body, frame and time; the world is closed all the same,
    and the whole frames before are kept."""
    engine.diverge_at = 6
    with pytest.raises(
        RunEnded, match=r"diverged: the position of 'box' is not finite, in frame 2 at 0\.1500 s"
    ) as end:
        record(engine, scenario, settings)
    kept = end.value.recording
    assert kept.ended == str(end.value)
    # frame 1 is whole, with the contacts of its steps from the second on; frame 2 is not
    assert (len(kept.time), len(kept.time_frame), len(kept.work)) == (2, 1, 1)
    assert len(kept.contacts) == SUBSTEPS - 1
    assert engine.worlds[0].closed


def test_warm_up_plays_a_world_of_its_own(engine, scenario, settings):
    """Warming up plays a few frames of a world that is closed and not used again."""
    warm_up(engine, scenario, settings)
    assert engine.worlds[0].steps == WARM_UP_FRAMES * SUBSTEPS
    assert engine.worlds[0].closed


@pytest.mark.parametrize(
    ("dt", "count"), [(1 / 10, 1), (1 / 20, 2), (0.1 / 3, 3), (1e-4, 1000), (0.1 + 1e-13, 1)]
)
def test_steps_that_divide_the_frame(scenario, dt, count):
    """A step that divides the frame, to rounding, gives its number per frame."""
    assert substeps(scenario, dt) == count


@pytest.mark.parametrize("dt", [1 / 7, 0.2, 0.1 * (1 + 1e-6), 0.0, -0.1, float("nan"), float("inf")])
def test_steps_that_do_not_divide_the_frame_are_refused(scenario, dt):
    """Any other step is refused by name, with the frame it should divide."""
    with pytest.raises(ValueError, match=r"does not divide the frame of 1/10 s"):
        substeps(scenario, dt)


def test_too_many_contacts_are_an_error(scenario):
    """More contact points than there is room for are an error, never a silent loss."""
    state = State(scenario)
    add = (0, 1, np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.0, np.zeros(3))
    for _ in range(CONTACT_CAPACITY):
        state.add_contact(*add)
    with pytest.raises(AdapterError, match=f"more than {CONTACT_CAPACITY} contact points in one step"):
        state.add_contact(*add)


def test_too_many_contacts_name_the_frame(engine, scenario, settings, monkeypatch):
    """A full contact buffer ends the run with one line that names the frame."""
    monkeypatch.setattr("touchstone.adapters.contract.contact_capacity", lambda _: 0)
    with pytest.raises(RunEnded) as end:
        record(engine, scenario, settings)
    reason = "more than 0 contact points in one step: the scene has too many contacts to record"
    # the fake's first contact is in its second step
    assert str(end.value) == f"{reason}, in frame 1 at 0.0500 s"


def test_time_of_other_processes_does_not_count(monkeypatch) -> None:
    """Take processor time where the process was preempted, wall time where it was not or waits by itself."""
    switches, processor = iter((5, 6, 5, 5)), iter((1.0, 1.25, 1.0, 1.25))
    monkeypatch.setattr(module, "process_time", lambda: next(processor))
    monkeypatch.setattr(module, "getrusage", lambda who: SimpleNamespace(ru_nivcsw=next(switches)))
    assert module.StepClock().own_seconds(2.0) == 0.25
    assert module.StepClock().own_seconds(2.0) == 2.0


def test_a_frame_is_its_native_steps(lab, monkeypatch) -> None:
    """Time the step calls alone, each after its own drive, numbered through from the first frame."""
    ticks = iter(range(100))
    monkeypatch.setattr("touchstone.adapters.recorder.perf_counter", lambda: next(ticks))
    calls: list[object] = []
    world = SimpleNamespace(drive=calls.append, step=lambda: calls.append("step"))
    assert frame_seconds(world, lab.scene(lab.ball()), Settings("any", 1 / 240), 2) == 4
    assert calls == [8, "step", 9, "step", 10, "step", 11, "step"]


@pytest.mark.parametrize(
    ("switches", "reported", "asked"),
    [([5, 5], 3.0, 1), ([5, 6, 6, 6], 2.0, 2), ([*range(100)], 0.5, 10)],
    ids=["at once", "second", "never"],
)
def test_disturbed_times_do_not_count(monkeypatch, switches, reported, asked) -> None:
    """Take the first measurement without a switch of processes, or the least of ten."""
    counts = iter(switches)
    monkeypatch.setattr(
        "touchstone.adapters.recorder.getrusage", lambda who: type("Usage", (), {"ru_nivcsw": next(counts)})
    )
    times = [3.0, 2.0, 4.0, 0.5, *[5.0] * 10]
    measured = iter(times)
    taken = []

    def measure() -> float:
        taken.append(next(measured))
        return taken[-1]

    assert undisturbed(measure) == reported
    assert len(taken) == asked
