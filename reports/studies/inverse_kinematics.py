"""The study `ik`: cyclic coordinate descent of profile `paper`, and a damped least-squares loop on pinocchio.

They solve for random reachable goals of the avatar's left arm; `balanced` and `accurate` use neither.

A goal is the position of the middle of the hand in a random posture within limits and reach cones. Starts:
`near`, each angle within 0.1 rad of that posture, and `rest`, the hanging arm. Solvers alternate goal by
goal. The reference is timed inside its one compiled call, pinocchio's loop in Python, where it runs; the cost
of a call is a row of its own. The loop gets the chain without reach cones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import nan
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pandas as pd

from touchstone.adapters.contract import Array
from touchstone.adapters.engines.reference.reference_world import translate
from touchstone.adapters.oracles.articulated import DampedLeastSquares
from touchstone.reference_impl.core.kernel import clock, kernel
from touchstone.reference_impl.kinematics.reach_cone import keep_in_cone
from touchstone.reference_impl.kinematics.skeleton import pose_links
from touchstone.reference_impl.paper.ccd_ik import CCD_PASSES, CCD_TOLERANCE, ccd_ik
from touchstone.reports.bootstrap import median_interval, time_ratio
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of
from touchstone.reports.studies.study import MICRO, RefusedError, failures, kept, with_interval
from touchstone.reports.verdict.judge import judged
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import exact_number
from touchstone.scenarios.avatar.avatar import HAND_LENGTH, avatar_parts, standing_tracker
from touchstone.scenarios.materials import TABLE_1
from touchstone.scenarios.scenario import Scenario, Vector

STUDY, CHAIN = "ik", "left_arm"
POINT: Vector = (0.0, 0.0, -HAND_LENGTH / 2)
"""The end effector in the hand's frame [m]."""
NEAR = 0.1
"""Largest difference of each angle of a near start from the goal's posture [rad]."""
STARTS = ("arm, near", "arm, rest")
DAMPING, STEPS = 0.01, 200
"""Damping of pinocchio's loop [m], the fastest of 0.01, 0.03 and 0.1, and its iteration limit."""
IK_TOLERANCE = 1e-5
"""Distance from the goal at which it counts as reached, and at which pinocchio's loop ends [m]."""
CCD, LOOP = "ccd as printed", "damped least squares"
SOLVERS = (("reference", CCD), ("pinocchio", LOOP))
MEASURED = ("ik.missed", "ik.left", "ik.passes", "time.solve", "time.crossing", "ratio.time")
CROSSINGS = 1000
Answer = Sequence[Any]


class Arm:
    """The arm of a person whose torso's frame is the world's, and all solvers on it."""

    def __init__(self) -> None:
        parts = avatar_parts()
        tracker = standing_tracker(parts, (0.0, 0.0, 0.0), 1.0)
        bodies, joints, chains = parts
        scenario = Scenario(
            *(STUDY, "", (), bodies, 1.0, TABLE_1), joints=joints, trackers=(tracker,), chains=chains
        )
        index = [chain.name for chain in chains].index(CHAIN)
        self.world = translate(scenario)
        self.first, self.last = map(int, self.world.drivers[0]["chains"][index])
        self.joints = self.world.joints[self.first : self.last + 1]
        self.loop = DampedLeastSquares(scenario, chains[index], POINT, DAMPING, STEPS)
        self._point = np.zeros(3)

    def place(self, angles: Array) -> Array:
        """Pose the arm and return a copy of the end effector's position (3,) [m]."""
        self.joints["angle"] = angles
        pose_links(self.world.bodies, self.world.joints, self.world.drivers[0])
        hand = self.world.bodies[self.joints[-1]["child"]]
        self._point[:] = hand["position"] + hand["rotation"] @ np.array(POINT)
        return self._point.copy()

    def allows(self, angles: Array) -> bool:
        """Whether a posture is within limits and reach cones."""
        if (angles < self.joints["lower"]).any() or (angles > self.joints["upper"]).any():
            return False
        self.joints["angle"], self.joints["last_angle"] = angles, 0.0
        self.joints["cosine"], self.joints["sine"] = np.cos(angles), np.sin(angles)
        balls = [k for k in range(self.first, self.last + 1) if self.world.joints[k]["cone_count"]]
        return not any(keep_in_cone(self.world.joints, k) for k in balls)

    def solve(self, engine: str, start: Array, goal: Array) -> tuple[Answer, float]:
        """A solver's result (passes or steps, remaining distance [m], whether it converged), and its
        seconds."""
        self.place(start)
        if engine == "pinocchio":
            begin = perf_counter()
            steps, left, _ = self.loop.solve(start, goal, IK_TOLERANCE)
            return (steps, left, left <= IK_TOLERANCE), perf_counter() - begin
        passes, left, seconds = solve_chain(*self._arguments(goal))
        return (passes, left, left <= IK_TOLERANCE), seconds

    def _arguments(self, goal: Array) -> tuple[Any, ...]:
        world = self.world
        return (world.bodies, world.joints, self.first, self.last, self._point, goal, world.state)

    def cross(self, engine: str) -> float:
        """Seconds of the cheapest call: an empty one with a solver's arguments, or one into pinocchio."""
        begin = perf_counter()
        if engine == "pinocchio":
            self.loop.cross()
        else:
            _nothing(*self._arguments(self._point))
        return perf_counter() - begin


@kernel
def solve_chain(bodies, joints, first, last, point, goal, state):  # type: ignore[no-untyped-def]
    """Solve for a goal by `ccd_ik`: passes, remaining distance, seconds."""
    s = state[0]
    for i in range(3):
        s["point"][i], s["goal"][i] = point[i], goal[i]
    start = clock(s["clock"])
    passes, left = ccd_ik(bodies, joints, first, last, s)
    return passes, left, clock(s["clock"]) - start


@kernel
def _nothing(bodies, joints, first, last, point, goal, state):  # type: ignore[no-untyped-def]
    """An empty compiled call."""


def draw(arm: Arm, count: int, seed: int) -> tuple[Array, Array]:
    """Postures (count, j) [rad], uniform within limits and reach cones, and near starts."""
    rng = np.random.default_rng(seed)
    lower, upper = arm.joints["lower"].copy(), arm.joints["upper"].copy()
    postures = np.array([_draw_one(arm, rng, lower, upper) for _ in range(count)])
    near = np.array([_draw_one(arm, rng, posture - NEAR, posture + NEAR) for posture in postures])
    return postures, near


def _draw_one(arm: Arm, rng: np.random.Generator, lower: Array, upper: Array) -> Array:
    while True:
        angles = rng.uniform(lower, upper)
        if arm.allows(angles):
            return angles


def steps(goals: int) -> int:
    """Number of progress steps of a run: goals times starts."""
    return goals * len(STARTS)


def run(goals: int, seed: int, out: Path, progress: Progress) -> pd.DataFrame:
    """Measure all solvers; store rows and manifest. The folder appears complete or not at all."""
    with output_folder(out) as folder:
        facts = {"study": STUDY, "goals": goals, "seed": seed, "chain": CHAIN}
        facts |= {"tolerance": CCD_TOLERANCE, "passes": CCD_PASSES}
        facts |= {"pinocchio": {"damping": DAMPING, "steps": STEPS}}
        return kept(rows(goals, seed, progress), folder, facts)


def rows(count: int, seed: int, progress: Progress) -> list[Row]:
    """Measure all solvers on `count` goals from both starts."""
    if count < 1:
        raise RefusedError(f"--goals {count}: expected at least 1")
    arm = Arm()
    postures, near = draw(arm, count, seed)
    goals = np.array([arm.place(posture) for posture in postures])
    starts = dict(zip(STARTS, (near, np.zeros_like(near))))
    for solver in SOLVERS:
        arm.solve(solver[0], near[0], goals[0])
        arm.cross(solver[0])
    found: list[Row] = []
    for name, start in starts.items():
        answers = {solver: np.zeros((count, 4)) for solver in SOLVERS}
        for k in range(count):
            for turn in range(len(SOLVERS)):
                solver = SOLVERS[(k + turn) % len(SOLVERS)]
                (passes, left, arrived), seconds = arm.solve(solver[0], start[k], goals[k])
                answers[solver][k] = passes, left, arrived, seconds
            progress(name, 1)
        for (engine, profile), mine in answers.items():
            base = Row(STUDY, name, engine, profile, nan, "", seed=seed)
            found += _rows_of(base, mine, answers["pinocchio", LOOP][:, 3])
    crossings = {engine: np.array([arm.cross(engine) for _ in range(CROSSINGS)]) for engine, _ in SOLVERS}
    for engine, sample in crossings.items():
        base = Row(STUDY, "arm", engine, "", nan, "time.crossing", unit="s", seed=seed)
        found.append(with_interval(base, median_interval(sample)))
    return [judged(row, ()) for row in found]


def _rows_of(base: Row, answers: Array, loop_seconds: Array) -> list[Row]:
    passes, left, arrived, seconds = answers.T
    found = [
        replace(base, metric="ik.missed", unit="1", value=float(1 - arrived.mean())),
        replace(base, metric="ik.left", subject="max", unit="m", value=float(left.max())),
    ]
    for subject, part in (("median", 50), ("p95", 95), ("max", 100)):
        value = float(np.percentile(passes, part))
        found.append(replace(base, metric="ik.passes", subject=subject, unit="1", value=value))
    found.append(with_interval(base, median_interval(seconds), metric="time.solve", unit="s"))
    if base.engine != "pinocchio":
        ratio = time_ratio(seconds, loop_seconds)
        found.append(with_interval(base, ratio, metric="ratio.time", subject="pinocchio", unit="1"))
    return found


HEADS = (
    *("start", "solver", "missed\n[%]", "farthest\n[m]", "passes\nmedian", "p95", "max"),
    *("solve\n[µs]", "over pinocchio\n(95 % interval)"),
)
NOTES = (
    "missed: goals not reached to 1e-5 m; the loop gets no reach cones and 200 steps",
    "solve: the reference inside its compiled call, pinocchio's loop from Python",
)


def report(frame: pd.DataFrame) -> list[Part]:
    """One row per start and solver, the cost of a call, and every broken limit."""
    rows = []
    for start in STARTS:
        for engine, profile in SOLVERS:
            part = frame[(frame.scenario == start) & (frame.engine == engine) & (frame.profile == profile)]
            rows.append([start, f"{engine} {profile}", *_cells(part)])
    calls = [
        f"a call into {row.engine}: {exact_number(row.value * MICRO)} µs"
        for row in rows_of(frame[frame.metric == "time.crossing"])
    ]
    title = "ik: random reachable goals of the left arm"
    return [Part(title, HEADS, rows, (*calls, *NOTES), words=2, tight=True), failures(frame)]


def _cells(part: pd.DataFrame) -> list[str]:
    mine = {(row.metric, row.subject): row for row in rows_of(part)}
    ratio = mine.get(("ratio.time", "pinocchio"))
    return [
        exact_number(100 * mine["ik.missed", ""].value),
        exact_number(mine["ik.left", "max"].value),
        *(f"{mine['ik.passes', subject].value:.0f}" for subject in ("median", "p95", "max")),
        exact_number(mine["time.solve", ""].value * MICRO),
        f"{ratio.value:.2f} ({ratio.low:.2f} to {ratio.high:.2f})" if ratio is not None else "",
    ]
