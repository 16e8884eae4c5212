"""What a run is checked for: numbers, speeds, energies and places."""

from dataclasses import replace

import numpy as np
import pytest
from fake_world import FakeWorld

from touchstone.adapters.contract import Settings, State
from touchstone.adapters.divergence import EXPLODED, SPEED_MAX, Watch, largest_work
from touchstone.adapters.motion_bounds import planned
from touchstone.adapters.recorder import RunEnded, record
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.scenario import Scenario

FRAME = 1 / 60


class Script(FakeWorld):
    """World that does what a function of time says: `motion(state, t)`; it is its own engine."""

    def __init__(self, motion):
        self.motion = motion

    def build(self, scenario, settings):
        super().__init__("script", scenario, settings)
        return self

    def read(self, state):
        state.position[:] = [body.position for body in self.scenario.bodies]
        self.motion(state, self.steps * FRAME)


def ended(motion, scenario: Scenario, effects=None) -> RunEnded:
    """How a run of a script ends before its scene does."""
    with pytest.raises(RunEnded) as caught:
        record(Script(motion), scenario, Settings("only", FRAME, effects=effects))
    assert caught.value.recording.ended == str(caught.value)
    return caught.value


@pytest.fixture
def scenario(lab):
    """A ball of 1 kg that falls from 1 m onto the ground; it can reach no more than 9.81 J there."""
    return lab.scene(lab.ball(), lab.ground())


@pytest.fixture
def state(scenario):
    """The state of a body at rest where the scene starts."""
    still = State(scenario)
    still.position[:] = [body.position for body in scenario.bodies]
    return still


@pytest.mark.parametrize(
    "name", ["position", "orientation", "linear_velocity", "angular_velocity"], ids=lambda name: name
)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_every_number_of_a_body_must_be_finite(scenario, state, name, value):
    """Name the quantity and the body of the first number that is not finite."""
    watch = Watch(scenario)
    assert watch.step_fault(state) is None
    getattr(state, name)[1, 2] = value
    expected = f"diverged: the {name.replace('_', ' ')} of 'ground' is not finite"
    assert watch.step_fault(state) == expected


@pytest.mark.parametrize(
    ("name", "unit"), [("linear_velocity", "m/s"), ("angular_velocity", "rad/s")], ids=["linear", "angular"]
)
def test_absurd_speeds_are_told(scenario, state, name, unit):
    """Tell a speed above SPEED_MAX with its body, even one whose square overflows, and none below."""
    watch = Watch(scenario)
    getattr(state, name)[0, 1] = -0.99 * SPEED_MAX
    getattr(state, name)[1, 1] = 0.99 * SPEED_MAX
    assert watch.step_fault(state) is None
    for speed in (1e30, 1e200):
        getattr(state, name)[0, 1] = -speed
        assert (
            watch.step_fault(state)
            == f"diverged: the {name.replace('_', ' ')} of 'ball' is {speed:.2g} {unit}"
        )


def test_a_body_beyond_any_scene_has_diverged(scenario, state):
    """Tell a position that no recording may hold, with its body."""
    state.position[1, 0] = 1e30
    assert Watch(scenario).step_fault(state) == "diverged: the position of 'ground' is beyond 1e+30"


def test_a_small_body_may_spin_fast(lab):
    """Judge a rotation by the speed of the surface: 1e7 rad/s of a ball of 1 mm are 10 km/s."""
    scenario = lab.scene(lab.ball(radius=1e-3), lab.ground())
    state = State(scenario)
    state.angular_velocity[0, 2] = 1e7
    assert Watch(scenario).step_fault(state) is None
    state.angular_velocity[0, 2] = 1.01e9
    assert Watch(scenario).step_fault(state) == "diverged: the angular velocity of 'ball' is 1e+09 rad/s"


def test_far_places_are_finite_numbers(scenario, state):
    """Say nothing of a place far away where nothing bounds it: it may be a body that falls for hours."""
    state.position[0] = (1e9, 0.0, 0.0)
    assert Watch(scenario).step_fault(state) is None


def test_energy_from_nowhere_is_divergence(scenario):
    """Blame energy where a body leaves its bounds with more of it than the scene allows, and name it."""

    def motion(state, t):
        if t > 0.09:
            state.position[0, 0] = 181.0
            state.linear_velocity[0, 0] = 3e3

    end = ended(motion, scenario)
    # the ball has not fallen: what is allowed is the noise of both at rest, 1 kg (0.1 m/s)^2 / 2
    reported = (
        "diverged: 'ball' moves at 3e+03 m/s, energy 4.5e+06 J of at most 0.005 J, in frame 6 at 0.1000 s"
    )
    assert str(end) == reported
    assert end.recording.position[-1, 0, 0] == 181.0


def test_a_plan_that_is_left_at_a_normal_energy_is_blamed(scenario):
    """Blame the plan where a body leaves its bounds with no more energy than it may have."""

    def motion(state, t):
        # creeps away without falling
        state.position[0, 0] = 100.0 * t

    reported = str(ended(motion, scenario))
    assert reported.startswith("ball left the bounds of its plan (the plan does not hold; --effects all ")
    assert "diverged" not in reported


def test_without_bounds_only_an_explosion_ends_a_run(scenario):
    """Play on at twice the energy where nothing is bounded, and end at EXPLODED times the energy."""
    allowed = 0.005 + 9.81 * 0.5

    def motion(state, t):
        state.position[0, 2] = 0.5
        energy = EXPLODED * allowed * (1.01 if t > 0.91 else 0.99)
        state.linear_velocity[0, 1] = np.sqrt(2 * energy)

    assert "in frame 55 at 0.9167 s" in str(ended(motion, scenario, PLANNED))


def test_spin_is_energy_too(scenario):
    """Count the energy of a spin along the body's own axes, and say that the body turns."""

    def motion(state, t):
        state.orientation[0] = np.array([1.0, 1.0, 0.0, 0.0]) / np.sqrt(2)
        state.angular_velocity[0] = (0.0, 4e3, 0.0)

    # 2/5 m r^2 = 1e-3 kg m^2
    reported = str(ended(motion, scenario, PLANNED))
    assert reported.startswith("diverged: 'ball' turns at 4e+03 rad/s, energy 8e+03 J of at most 0.005 J")


def test_what_falls_may_be_fast(scenario, state):
    """Allow what gravity does: a ball that falls by 2 km, and what it had at the start."""
    thrown = replace(scenario.bodies[0], linear_velocity=(30.0, 0.0, 0.0))
    for one in (scenario, replace(scenario, bodies=(thrown, scenario.bodies[1]))):
        watch, start = Watch(one, planned(one, PLANNED)), one.bodies[0].linear_velocity
        for t in (1.0, 20.0):
            state.position[0] = (start[0] * t, 0.0, 1 - 9.81 * t * t / 2)
            state.linear_velocity[0] = (start[0], 0.0, -9.81 * t)
            assert watch.step_fault(state) is None
            assert watch.frame_fault(state) is None


def test_drivers_may_lift_and_throw(lab):
    """Allow what a hand may pass on: its speed twice over, and slow lifts by metres."""
    hand = lab.block("hand", (0.1, 0.1, 0.1), (0.0, 0.0, 0.0), kind="driven")
    tracker = lab.still("hand", (0.0, 0.0, 0.0), (0.0, 0.0, 2.0))
    scene = lab.scene(lab.ball(position=(0.0, 0.0, 0.15)), hand, trackers=(tracker,))
    watch, state = Watch(scene, planned(scene, PLANNED)), State(scene)
    state.position[0, 2] = 10.0
    # the tracker's largest speed is 3 m/s, of a cubic ease over 2 m in a second
    state.linear_velocity[0, 2] = 6.0
    assert watch.frame_fault(state) is None
    state.linear_velocity[0, 2] = 6e3
    assert "diverged: 'ball' moves at 6e+03 m/s" in str(watch.frame_fault(state))


def test_kinetic_energy_stays_below_its_bound():
    """The bound that spares the exact energy is never below it."""
    scene = catalogue()["table_slide"]
    watch, state, rng = Watch(scene), State(scene), np.random.default_rng(4)
    for _ in range(50):
        state.values[:] = rng.normal(size=len(state.values))
        state.orientation /= np.linalg.norm(state.orientation, axis=1)[:, None]
        exact = float(watch._kinetic(state).sum())
        assert exact <= watch._largest_kinetic(state) < 2 * exact


def test_motors_and_springs_may_add_energy() -> None:
    """Allow what a motor can do in the time of its scene and what a spring releases, not more."""
    motor, spring = (catalogue()[name] for name in ("motor_hinge", "slider_spring"))
    found = motion(motor, motor.truths[0], np.array([motor.duration]))
    spun = motor.bodies[0].inertia[2][2] * float(np.sum(found.angular_velocity**2)) / 2
    allowed = largest_work(motor.body_joints[0], motor.duration)
    assert spun < allowed < 20 * spun
    stretched = replace(spring.body_joints[0], target=0.1)
    assert largest_work(stretched, 1.0) == pytest.approx(stretched.stiffness * 0.1**2 / 2)
    assert largest_work(spring.body_joints[0], 1.0) == 0
