"""Short scenes in profile `paper`, and the figures that `paper_choices.py` measures on them."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.reference.engine import ReferenceEngine
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording, RunEnded
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Body, PairCoefficients, Scenario, Tracker
from touchstone.scenarios.solids import ball, block

FRAME, GRAVITY, RADIUS, WEIGHTLESS = 1 / 60, 9.81, 0.05, (0.0, 0.0, 0.0)
TIMES = np.arange(61) * FRAME
FLOOR = block("floor", "wood", (5.0, 5.0, 0.5), position=(0.0, 0.0, -0.5), kind="fixed")


def play(scenario: Scenario) -> Recording:
    """Play a scene in profile `paper`."""
    return record(ReferenceEngine(), scenario, Settings("paper", FRAME))


def scene(*bodies: Body, e: float = 0.0, mu: float = 0.0, duration: float = 1.0, **fields) -> Recording:
    """Play a scene of wood."""
    pairs = (PairCoefficients("wood", "wood", e, mu),)
    return play(Scenario("test", "", (), bodies, duration, pairs, **fields))


def hand(x, *others: Body, y=0.0, turn=0.0, mass: float = 0.4, **fields) -> Recording:
    """Play a driven ball that follows x and y [m] and an angle about z [rad] for a second, among others."""
    places = np.column_stack(np.broadcast_arrays(x, y, 0 * TIMES)).tolist()
    turns = np.column_stack(np.broadcast_arrays(np.cos(turn / 2), 0, 0, np.sin(turn / 2), 0 * TIMES))[:, :4]
    poses = (tuple(map(tuple, places)), tuple(map(tuple, turns.tolist())))
    path = Tracker("hand", (), tuple(TIMES.tolist()), *poses, ((),) * len(TIMES))
    driven = replace(ball("hand", "wood", RADIUS, mass), kind="driven")
    return scene(driven, *others, trackers=(path,), gravity=WEIGHTLESS, **fields)


def wall(name: str, x: float, y: float = 0.0) -> Body:
    """A fixed cube of 1 m."""
    return block(name, "wood", (0.5, 0.5, 0.5), position=(x, y, 0.0), kind="fixed")


def counted(run: Recording, name: str) -> np.ndarray:
    """A counter in every frame."""
    return run.work[:, list(run.work_names).index(name)]


def settled(mass: float) -> str:
    """Distance from a tracker half a second after it jumped by 10 cm."""
    try:
        return f"{1e3 * abs(0.1 - hand(0.1 * (TIMES > 0.49), mass=mass).position[-1, 0, 0]):.1f} mm"
    except RunEnded:
        return "diverges"


def turn_lag() -> str:
    """Largest lag behind a tracker that turns."""
    turn = np.clip(10 * (TIMES - 0.1), 0, 1)
    q = hand(0.0, turn=turn).orientation[:, 0]
    return f"{np.degrees(np.abs(2 * np.arctan2(q[:, 3], q[:, 0]) - turn).max()):.1f} deg"


def slot_gap() -> str:
    """Distance from a slot's edges in the first frame in which a wider ball overlaps them."""
    run = hand(0.0, wall("left", -0.54, 0.5), wall("right", 0.54, 0.5), y=np.minimum(3 * TIMES - 0.3, 0.2))
    y = run.position[1:][counted(run, "way_back") > 0][0, 0, 1]
    return f"{round(1e3 * (np.hypot(y, 0.04) - RADIUS), 1) + 0.0:.1f} mm"


def squeezed() -> str:
    """Most impulses in a frame of a ball between hand and wall."""
    still = ball("ball", "wood", RADIUS, 0.2, (0.08, 0.0, 0.0))
    run = hand(np.minimum(0.3 * TIMES - 0.15, 0.05), still, wall("wall", 0.65), e=0.2, mu=0.2)
    return f"{counted(run, 'impulses').max():.0f}"


def pushed() -> str:
    """Way of the box of `push_box` in 2 s, and its highest speed."""
    scenario, end = catalogue()["push_box"], 121
    rows = {
        name: getattr(scenario.trackers[0], name)[:end] for name in ("times", "positions", "orientations")
    }
    path = replace(scenario.trackers[0], angles=scenario.trackers[0].angles[:end], **rows)
    run = play(replace(scenario, trackers=(path,), duration=(end - 1) * FRAME, expectations=()))
    box = scenario.body_index("box")
    return f"{np.ptp(run.position[:, box, 0]):.2f} m, {run.linear_velocity[:, box, 0].max():.2f} m/s"


def energy_error() -> str:
    """Largest change of a free box's energy in 10 s."""
    box = block("box", "wood", (0.1, 0.2, 0.3), 1.0, spin=(0.1, 5.0, 0.1))
    run = scene(box, gravity=WEIGHTLESS, duration=10.0)
    w = Rotation.from_quat(run.orientation[:, 0], scalar_first=True).inv().apply(run.angular_velocity[:, 0])
    energy = ((w @ np.array(box.inertia)) * w).sum(axis=1)
    return f"{100 * np.abs(energy / energy[0] - 1).max():.2f} %"


def impact_depth() -> str:
    """Depth at which a ball collides after a fall of 0.5 m."""
    run = scene(ball("ball", "wood", 0.1, 1.0, (0.0, 0.0, 0.6)), FLOOR, e=0.8)
    return f"{-1e3 * run.contacts['distance'].min():.3f} mm"


def middle_speed() -> str:
    """Speed of the middle one of three balls, which both others hit at 4 m/s."""
    balls = (
        ball(f"{k}", "wood", RADIUS, 1.0, (0.25 * k, 0.0, 0.0), (-4.0 * k, 0.0, 0.0)) for k in (-1, 0, 1)
    )
    return f"{scene(*balls, e=0.5, gravity=WEIGHTLESS).linear_velocity[-1, 1, 0]:+.2f} m/s"


def rolling_spin() -> str:
    """Spin of a ball that rolls after a fall with friction."""
    falling = ball("ball", "wood", RADIUS, 1.0, (0.0, 0.0, 0.3), (2.0, 0.0, 0.0))
    return f"{scene(falling, FLOOR, e=0.5, mu=0.3).angular_velocity[-1, 0, 1]:.4f} rad/s"


def broken() -> str:
    """Impulses of a break of 15 balls, and the highest speed after it."""
    run = play(catalogue()["break_15"])
    speeds = np.linalg.norm(run.linear_velocity[-1], axis=1)
    return f"{counted(run, 'impulses').sum():.0f} impulses, {speeds.max():.2f} m/s"


def fall_error() -> str:
    """Height above the parabola after a fall of 1 s."""
    height = scene(ball("ball", "wood", RADIUS, 1.0)).position[-1, 0, 2] + GRAVITY / 2
    return f"{round(1e3 * height, 1) + 0.0:+.1f} mm"


def jitter() -> str:
    """Range of heights of a ball on the floor."""
    run = scene(ball("ball", "wood", RADIUS, 1.0, (0.0, 0.0, RADIUS)), FLOOR, e=0.5)
    return f"{1e3 * np.ptp(run.position[:, 0, 2]):.2f} mm"


def lag() -> str:
    """Lag behind a tracker at 1 m/s."""
    path = np.maximum(0, TIMES - 0.1)
    return f"{1e3 * (path - hand(path).position[:, 0, 0])[-1]:.1f} mm"


def cornered() -> str:
    """Frames in which a ball that goes 2 cm into a corner goes back by step 4."""
    path = np.minimum(0.5 * TIMES - 0.1, 0.02)
    run = hand(path, wall("east", 0.5 + RADIUS), wall("north", 0.0, 0.5 + RADIUS), y=path)
    return f"{counted(run, 'way_back').sum():.0f} of {len(run.work)}"


def gone_back(name: str) -> str:
    """Frames of a person's scene that need step 4."""
    run = play(catalogue()[name])
    return f"{counted(run, 'way_back').sum():.0f} of {len(run.work)}"


def largest_turn(name: str) -> str:
    """Largest turn of a hinge in a frame of a scene."""
    turns = np.diff(play(catalogue()[name]).joint_angle, axis=0)
    return f"{np.degrees(np.abs(turns).max()):.0f} deg"
