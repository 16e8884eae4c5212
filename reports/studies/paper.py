"""The study `paper`: the experiments of Schmidl and Lin (2004) on the reference's profile `paper`.

Scenes are played in turn, several times in one process; a frame's time is the median over its plays. Counters
and poses repeat exactly. All effects are on: the paper has neither plans nor fat bounds, so collisions are
detected in every frame.

Claims of the paper are judged on these series. A rule returns a figure, which is compared with a bound, and
may add a second condition. Evidence is counts, times or poses; a rule uses times only where the claim is
about them.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import altair as alt
import numpy as np
import pandas as pd
from numpy.typing import NDArray
from rich.text import Text
from scipy.stats import spearmanr

from touchstone.adapters.contract import AdapterError, Array, Engine, Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import ENGINES, load
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.posture import tracked_depths
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of
from touchstone.reports.studies.study import failures, kept
from touchstone.reports.views.pictures import INK, axis, by, save
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import exact_number
from touchstone.scenarios.avatar.kinematics import tracked_poses
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.gallery import TABLE_HALF, TABLE_TOP
from touchstone.scenarios.scenario import Scenario

COLLISION, REMOVAL = "collision", "removal"
"""Stages: detection in both loops; overlap removal with inverse kinematics, without detection."""
PASSES, JOINTS, PAIRS, TESTED = "ccd.passes", "ik.joints", "pairs.contacting", "pairs"
SKIPPED = 1
"""Frames at the start without a figure: they fill caches [1]."""
RISE = 1.25
"""Least ratio of two levels of a curve that differ [1]: a quarter is seen in a plot."""
LONG, BRIEF = 0.5, 1.0
"""Least duration of a plateau, and largest one of a break between two [s]."""
FIRST, SETTLED = 0.1, 0.3
"""A first contact lasts until FIRST; the frames from then to SETTLED are those after it [s]."""
FLICKER = 3
"""Gaps of contact of so many frames or fewer are none [1]: a twentieth of a second is not seen."""
Frames = tuple[int, int]
"""First index of a stretch, and the one after its last."""


@dataclass(frozen=True, slots=True)
class Series:
    """A scene over its frames: their ends [s], their seconds and those of each stage (medians over the
    plays), and counters. `recording` is of one play, all frames included."""

    scenario: Scenario
    recording: Recording
    time: Array
    frame: Array
    stages: Mapping[str, Array]
    counts: Mapping[str, Array]

    @property
    def contacts(self) -> list[Frames]:
        """Stretches in which pairs of the driven body are in contact."""
        return runs(self.counts[PAIRS] > 0)

    @property
    def total(self) -> Array:
        """Seconds of all stages per frame."""
        return np.sum(list(self.stages.values()), axis=0)

    def share(self, stage: str, chosen: NDArray[np.bool_] | None = None) -> float:
        """Share of a stage in the time of all stages, over all or the chosen frames [1]."""
        where = slice(None) if chosen is None else chosen
        return float(self.stages[stage][where].sum() / self.total[where].sum())


def series_of(scenario: Scenario, plays: Sequence[Recording]) -> Series:
    """The series of several recordings of one scene in one process."""
    one = plays[0]
    frame = np.median([play.time_frame for play in plays], axis=0)
    stages = np.median([play.stage_seconds for play in plays], axis=0)
    return Series(
        scenario,
        one,
        one.time[1 + SKIPPED :],
        frame[SKIPPED:],
        {str(name): stages[SKIPPED:, k] for k, name in enumerate(one.stage_names)},
        {str(name): one.work[SKIPPED:, k] for k, name in enumerate(one.work_names)},
    )


def runs(flags: NDArray[np.bool_], gap: int = FLICKER) -> list[Frames]:
    """Stretches of true frames, joined over gaps of up to `gap` frames."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False]))))
    found: list[Frames] = []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist()):
        if found and first - found[-1][1] <= gap:
            first = found.pop()[0]
        found.append((first, end))
    return found


def is_plateau(part: Array, free: float) -> bool:
    """Whether a curve rises over its `free` level and stays: three quarters of the frames are RISE times as
    high, and the medians of both halves differ by less than RISE."""
    first, second = halves(part)
    return bool(np.quantile(part, 0.25) >= RISE * free and max(first, second) < RISE * min(first, second))


def halves(part: Array) -> tuple[float, float]:
    """Medians of both halves of a curve."""
    middle = len(part) // 2
    return float(np.median(part[:middle])), float(np.median(part[middle:]))


def plateaus(curve: Array, contacts: Sequence[Frames], rate: int) -> list[Frames]:
    """Stretches of contact that last LONG and are plateaus of a curve of `rate` frames per second, over its
    median before all contact."""
    if not contacts or contacts[0][0] == 0:
        return []
    free = float(np.median(curve[: contacts[0][0]]))
    return [(a, b) for a, b in contacts if b - a >= LONG * rate and is_plateau(curve[a:b], free)]


def first_contact(curve: Array, first: int, rate: int) -> tuple[float, float]:
    """Peak of a curve within FIRST of a contact, and its median from there to SETTLED."""
    early, late = first + round(FIRST * rate), first + round(SETTLED * rate)
    return float(curve[first:early].max()), float(np.median(curve[early:late])) if early < len(curve) else 0.0


def thirds(work: Array, answer: Array) -> tuple[list[float], list[float]]:
    """Medians of `work` and of `answer` in the thirds of the frames in the order of their work."""
    order = np.argsort(work, kind="stable")
    low, high = ([float(np.median(part)) for part in np.array_split(x[order], 3)] for x in (work, answer))
    return low, high


Scenes = Mapping[str, Series]


class Ruling(NamedTuple):
    """Deciding value and its bound, evidence, why the claim does not hold if so, and a second condition."""

    value: float
    bound: float
    unit: str
    evidence: str
    reason: str
    also: bool = True


@dataclass(frozen=True, slots=True)
class Claim:
    """A statement of the paper and its place there; `basis`: counts, times or poses; `scenes` it needs;
    `relation` of the value to its bound."""

    name: str
    place: str
    text: str
    basis: str
    scenes: tuple[str, ...]
    relation: str
    rule: Callable[[Scenes], Ruling]

    def holds(self, found: Ruling) -> bool:
        """Whether the value meets its bound, and the second condition holds."""
        return bool(RELATIONS[self.relation](found.value, found.bound)) and found.also


RELATIONS = {">=": operator.ge, "<=": operator.le, ">": operator.gt, "=": operator.eq}
CLAIMS: list[Claim] = []
Rule = Callable[[Scenes], Ruling]


def claim(
    name: str, place: str, text: str, basis: str, scenes: tuple[str, ...], relation: str
) -> Callable[[Rule], Rule]:
    """Add a claim to CLAIMS with the decorated rule."""

    def add(rule: Rule) -> Rule:
        CLAIMS.append(Claim(name, place, text, basis, scenes, relation, rule))
        return rule

    return add


def micro(seconds: Iterable[float]) -> str:
    """Times as text [µs]."""
    return ", ".join(f"{1e6 * one:.3g}" for one in seconds) + " µs"


def percent(*shares: float) -> str:
    """Shares as text [%]."""
    return ", ".join(f"{100 * one:.0f}" for one in shares) + " %"


def numbers(values: Iterable[float]) -> str:
    """Counts as text."""
    return ", ".join(f"{one:.0f}" for one in values)


HANDS = ("table_slide", "ball_snip")
PERSONS = ("two_arms", "wall_push", "arms_cross", "corner_slide")
SCENES = (*HANDS, *PERSONS)
IDLE = 0.45
"""Least share of the scene before the first contact [1]: the first half, less the approach to the table."""
FALL = 2.0
"""Least ratio of a spike to what follows it, or to free motion [1]: half of its height."""
MOST = 0.75
"""Least share of first contacts that follow the paper's tendency [1]."""
CORRELATED = 0.5
"""Least rank correlation over frames that is one [1]: weaker ones are not seen in a plot."""
GROWN = 1.05
"""Least ratio of two shares of the frame time that differ [1]: medians repeat to a few percent."""
RATE = 60.0
"""Upper end of the paper's range of frame rates [1/s]."""
RESOLVED = 1e-6
"""Largest depth of bodies that do not overlap [m]: removal ends there."""
PUSHED = 0.01
"""Least depth of a tracked link in a wall that holds it back visibly [m]."""
JUMP = 0.03
"""Largest way of a link in a frame beyond its tracker's own that is no jump [m]: 1.8 m/s at 60 Hz, a fast
reach."""
ROLLING = 0.1
"""Largest difference of what a rolling ball unrolls from its path, over the path [1]: it is not seen."""
FALLEN = 0.5
"""Least height by which a ball that left the table is lower [m]: most of the table's."""
FIG_7, FIG_8, RESULTS, TABLE, ARMS = "figure 7", "figure 8", "results", ("table_slide",), ("two_arms",)


def slides(s: Series) -> tuple[list[Frames], list[float], float]:
    """Plateaus of the frame time, their medians, and the median before all contact (infinite without) [s]."""
    found = plateaus(s.frame, s.contacts, s.scenario.frame_rate)
    free = float(np.median(s.frame[: s.contacts[0][0]])) if s.contacts else inf
    return found, [float(np.median(s.frame[a:b])) for a, b in found], free


@claim("idle", FIG_7, "The hand moves around in the first half, at a level frame time.", "times", TABLE, ">=")
def idle(scenes: Scenes) -> Ruling:
    """No contact before IDLE of the scene; the medians of both halves of that differ by less than RISE."""
    s = scenes["table_slide"]
    first = s.contacts[0][0] if s.contacts else len(s.time)
    levels, share = halves(s.frame[:first]), first / len(s.time)
    text = f"no contact in the first {percent(share)} of the scene; "
    text += f"median frame {micro(levels)} in its halves"
    return Ruling(share, IDLE, "1", text, "the curve drifts", max(levels) < RISE * min(levels))


@claim("plateaus", FIG_7, "Sliding over the table one way and back gives two plateaus of the frame time.",
       "times", TABLE, "=")  # fmt: skip
def two_plateaus(scenes: Scenes) -> Ruling:
    """Two stretches of contact are plateaus (`is_plateau`)."""
    found, levels, free = slides(scenes["table_slide"])
    text = f"median frame {micro(levels)} on plateaus, {micro([free])} in free motion"
    return Ruling(len(found), 2, "1", text, "expected two plateaus")


@claim(
    "break", FIG_7, "The frame time falls off briefly between them, as contact breaks.", "times", TABLE, ">="
)
def gap(scenes: Scenes) -> Ruling:
    """The lower plateau is RISE times the median between them, which lasts BRIEF at most."""
    s = scenes["table_slide"]
    found, levels, _ = slides(s)
    if len(found) != 2:
        return Ruling(0, RISE, "1", f"{len(found)} plateaus", "there is no break to measure")
    first, end = found[0][1], found[1][0]
    between, lasts = float(np.median(s.frame[first:end])), (end - first) / s.scenario.frame_rate
    text = f"median frame {micro([between])} in the {lasts:.2f} s between plateaus of {micro(levels)}"
    return Ruling(min(levels) / between, RISE, "1", text, "no fall, or not a brief one", lasts <= BRIEF)


@claim("ball spikes", FIG_7, "Spikes at the end are those of playing with the ball.",
       "counts, times", TABLE, ">=")  # fmt: skip
def ball_spikes(scenes: Scenes) -> Ruling:
    """Two or more groups of impacts, all after the plateaus and within FIRST, in frames over RISE times a
    plateau."""
    s = scenes["table_slide"]
    found, levels, _ = slides(s)
    end, level = (found[-1][1], max(levels)) if found else (len(s.time), inf)
    hits = runs(s.counts["events"] > 0, 0)
    late = [(a, b) for a, b in hits if a >= end and b - a <= FIRST * s.scenario.frame_rate]
    peaks = [float(s.frame[a:b].max()) for a, b in late]
    text = f"{len(late)} impacts of the ball after the slides, {len(hits) - len(late)} before, "
    text += f"in frames of {micro(peaks)}"
    at_the_end = len(late) == len(hits) and max(peaks, default=0.0) >= RISE * level
    return Ruling(len(late), 2, "1", text, "no spikes, or not at the end", at_the_end)


@claim("three spikes", FIG_8, "Three pushes into the wall in the second half give three spikes.",
       "counts, times", ARMS, "=")  # fmt: skip
def three_spikes(scenes: Scenes) -> Ruling:
    """Passes exceed half of their peak in three stretches, all in the second half, in frames over FALL times
    free motion."""
    s = scenes["two_arms"]
    passes, free = s.counts[PASSES], slides(s)[2]
    spikes = runs(passes > passes.max() / 2)
    peaks, times = ([float(x[a:b].max()) for a, b in spikes] for x in (passes, s.frame))
    starts = ", ".join(f"{s.time[a]:.2f}" for a, _ in spikes)
    text = f"peaks of {numbers(peaks)} passes at {starts} s of {s.time[-1]:.0f} s, "
    text += f"in frames of up to {micro(times)}, {micro([free])} in free motion"
    late = bool(spikes) and spikes[0][0] >= len(passes) // 2 and min(times) >= FALL * free
    return Ruling(len(spikes), 3, "1", text, "not three spikes, or not in the second half", late)


@claim("fall off", FIG_8, "Each spike falls off quickly, as fewer iterations are needed.",
       "counts, times", ARMS, ">=")  # fmt: skip
def fall_off(scenes: Scenes) -> Ruling:
    """Passes and frame time within FIRST of each contact are FALL times those after it (`first_contact`)."""
    s = scenes["two_arms"]
    found = [
        [first_contact(x, a, s.scenario.frame_rate) for a, _ in s.contacts]
        for x in (s.counts[PASSES], 1e6 * s.frame)
    ]
    ratio = min((peak / max(after, 1e-9) for row in found for peak, after in row), default=0.0)
    parts = ["; ".join(f"{peak:.0f} to {after:.0f}" for peak, after in row) for row in found]
    text = f"from the first 0.1 s to the next 0.2 s passes fall {parts[0]}; frames {parts[1]} µs"
    return Ruling(ratio, FALL, "1", text, "a spike keeps more than half of its height")


@claim("coherence", RESULTS, "A limb's first contact takes more iterations than the frames that follow.",
       "counts", PERSONS, ">=")  # fmt: skip
def coherence(scenes: Scenes) -> Ruling:
    """At MOST of the contacts after free motion the peak of passes is RISE times those that follow."""
    found = [
        (n, *first_contact(scenes[n].counts[PASSES], a, scenes[n].scenario.frame_rate))
        for n in PERSONS
        for a, _ in scenes[n].contacts
    ]
    share = float(np.mean([peak >= RISE * after for _, peak, after in found])) if found else 0.0
    text = "passes in the first 0.1 s of contact and in the next 0.2 s: "
    text += "; ".join(f"{n} {peak:.0f}, {after:.0f}" for n, peak, after in found)
    return Ruling(share, MOST, "1", text, "iterations do not fall after most first contacts")


def pooled(scenes: Scenes, value: Callable[[Series], Array], counter: str) -> Array:
    """A series of all scenes with a person, in the frames in which a counter is positive."""
    return np.concatenate([value(scenes[n])[scenes[n].counts[counter] > 0] for n in PERSONS])


@claim("cost", RESULTS, "The cost of overlap avoidance with IK rises with CCD iterations and joints handled.",
       "times", PERSONS, ">=")  # fmt: skip
def cost(scenes: Scenes) -> Ruling:
    """Seconds of removal correlate with passes and with joints by ranks."""
    spent = pooled(scenes, lambda s: s.stages[REMOVAL], PASSES)
    counts = [pooled(scenes, lambda s: s.counts[PASSES], PASSES)]
    counts.append(pooled(scenes, lambda s: s.counts[JOINTS], PASSES))
    passes, joints = (float(spearmanr(one, spent).statistic) for one in counts)
    order = sorted(PERSONS, key=lambda n: scenes[n].frame.mean())
    text = f"rank correlation of removal's seconds with passes {passes:.2f}, with joints {joints:.2f}; "
    means = ", ".join(f"{n} {scenes[n].counts[PASSES].mean():.1f}" for n in order)
    text += f"passes per frame by cost: {means}"
    return Ruling(min(passes, joints), CORRELATED, "1", text, "no clear correlation")


@claim("IK share", RESULTS, "IK's share of the frame time grows moderately with joints and iterations.",
       "times", PERSONS, ">=")  # fmt: skip
def ik_share(scenes: Scenes) -> Ruling:
    """From the lowest to the highest third of frames removal's share grows, by less than the work does."""
    share = pooled(scenes, lambda s: s.stages[REMOVAL] / s.total, PASSES)
    passes, by_passes = thirds(pooled(scenes, lambda s: s.counts[PASSES], PASSES), share)
    joints, by_joints = thirds(pooled(scenes, lambda s: s.counts[JOINTS], PASSES), share)
    growth = [by_passes[2] / by_passes[0], by_joints[2] / by_joints[0]]
    text = f"median share in thirds of the frames: {percent(*by_passes)} at {numbers(passes)} passes; "
    text += f"{percent(*by_joints)} at {numbers(joints)} joints"
    slower = growth[0] < passes[2] / passes[0] and growth[1] < joints[2] / joints[0]
    return Ruling(min(growth), GROWN, "1", text, "it does not grow, or as fast as the work", slower)


@claim("pairs share", RESULTS, "Collision detection's share of the frame time grows with contacting pairs.",
       "times", PERSONS, ">=")  # fmt: skip
def pairs_share(scenes: Scenes) -> Ruling:
    """Detection's share correlates with contacting pairs by ranks, over frames in contact."""
    pairs = pooled(scenes, lambda s: s.counts[PAIRS], PAIRS)
    share = pooled(scenes, lambda s: s.stages[COLLISION] / s.total, PAIRS)
    spent = pooled(scenes, lambda s: s.stages[COLLISION], PAIRS)
    removed = pooled(scenes, lambda s: s.stages[REMOVAL], PAIRS)
    found = float(spearmanr(pairs, share).statistic) if np.ptp(pairs) > 0 else 0.0
    levels = np.unique(pairs)
    shares, ours, others = (
        [float(np.median(values[pairs == level])) for level in levels] for values in (share, spent, removed)
    )
    text = f"rank correlation {found:.2f} over frames in contact; median share {percent(*shares)} at "
    text += f"{numbers(levels)} pairs"
    why = f"detection takes {micro(ours)} there, removal {micro(others)}"
    return Ruling(found, CORRELATED, "1", text, why)


@claim("corner contacts", RESULTS, "In the corner the arm is more tightly contacting, from two sides.",
       "counts", SCENES, ">")  # fmt: skip
def corner_contacts(scenes: Scenes) -> Ruling:
    """More pairs are in contact at a time than in any other scene."""
    most = {n: float(scenes[n].counts[PAIRS].max()) for n in SCENES}
    corner = most.pop("corner_slide")
    others = max(most.values())
    text = f"up to {corner:.0f} pairs in contact at a time, in the other scenes up to {others:.0f}"
    return Ruling(corner, others, "1", text, "no more than elsewhere")


@claim("corner cost", RESULTS, "The cost of collision detection rises accordingly in the corner.",
       "times", PERSONS, ">")  # fmt: skip
def corner_cost(scenes: Scenes) -> Ruling:
    """Mean seconds of detection over frames in contact are more than in any other scene with a person."""
    spent = {n: float(scenes[n].stages[COLLISION][scenes[n].counts[PAIRS] > 0].mean()) for n in PERSONS}
    text = "mean time of detection over frames in contact: "
    text += ", ".join(f"{n} {micro([one])}" for n, one in spent.items())
    corner = spent.pop("corner_slide")
    return Ruling(corner, max(spent.values()), "s", text, "it costs as much elsewhere")


@claim("corner share", RESULTS, "Collision queries play a bigger role in the corner.", "times", PERSONS, ">")
def corner_share(scenes: Scenes) -> Ruling:
    """Detection's share over frames in contact is larger than in any other scene with a person."""
    touching = {n: scenes[n].counts[PAIRS] > 0 for n in PERSONS}
    shares = {n: scenes[n].share(COLLISION, touching[n]) for n in PERSONS}
    text = "share of detection over frames in contact: "
    text += ", ".join(f"{n} {percent(share)}" for n, share in shares.items())
    corner = shares.pop("corner_slide")
    removal = scenes["corner_slide"].share(REMOVAL, touching["corner_slide"])
    return Ruling(corner, max(shares.values()), "1", text, f"removal with IK takes {percent(removal)} there")


@claim("bottleneck", "conclusion", "Collision queries are the bottleneck.", "times", SCENES, "=")
def bottleneck(scenes: Scenes) -> Ruling:
    """Detection is the largest stage of every scene."""
    largest = {n: max((s.share(stage), stage) for stage in s.stages) for n, s in scenes.items()}
    count = sum(stage == COLLISION for _, stage in largest.values())
    text = ", ".join(f"{n} {stage} {percent(share)}" for n, (share, stage) in largest.items())
    text = f"largest stage: {text}"
    return Ruling(count, len(scenes), "1", text, "removal with IK is larger where persons push")


@claim(
    "frame rate", "abstract", "All scenes stay clearly above 30 fps, at 30 to 60 Hz.", "times", SCENES, ">="
)
def frame_rate(scenes: Scenes) -> Ruling:
    """The slowest frame of all scenes allows RATE."""
    slowest, name = max((float(s.frame.max()), n) for n, s in scenes.items())
    text = f"{1 / slowest:,.0f} per second at the slowest frame ({name}), undrawn, on a processor of today"
    return Ruling(1 / slowest, RATE, "1/s", text, "a frame is too slow")


@claim("hand", RESULTS, "The hand is pushed back by pure translation; it uses no IK.", "counts", HANDS, "=")
def hand_without_ik(scenes: Scenes) -> Ruling:
    """No passes of CCD, but rounds of translation."""
    passes, rounds = (float(sum(scenes[n].counts[c].sum() for n in HANDS)) for c in (PASSES, "rounds"))
    text = f"{passes:.0f} passes of CCD and {rounds:.0f} rounds of translation"
    return Ruling(passes, 0, "1", text, "joints are turned, or nothing is pushed", rounds > 0)


@claim("self-collision", "overlap avoidance", "Five chains in random order resolve overlap of arm with arm.",
       "poses", ("arms_cross",), "<=")  # fmt: skip
def self_collision(scenes: Scenes) -> Ruling:
    """Arms meet, and no frame shows overlap over RESOLVED."""
    s = scenes["arms_cross"]
    overlap = Context(s.recording, s.scenario).distances.overlap()
    frames = int((s.counts[PAIRS] > 0).sum())
    text = f"arms in contact in {frames} frames; deepest overlap {overlap.max():.1e} m, in the last frame "
    text += f"{overlap[-1]:.0e} m; the order of the chains is not varied here"
    return Ruling(float(overlap.max()), RESOLVED, "m", text, "arms overlap, or never meet", frames > 0)


@claim("ball", "figure 1", "A finger snips a ball, which rolls off the table.", "poses", ("ball_snip",), "<=")
def rolls_off(scenes: Scenes) -> Ruling:
    """In the last SETTLED before the edge the ball unrolls its path to within ROLLING; then it falls."""
    s = scenes["ball_snip"]
    r, ball = s.recording, s.scenario.body_index("ball")
    place, velocity = r.position[:, ball], r.linear_velocity[:, ball]
    edge = int(np.argmax(place[:, 0] > TABLE_HALF[0]))
    if edge == 0:
        return Ruling(inf, ROLLING, "1", "the ball does not reach the table's edge", "it stays")
    radius, last = place[0, 2] - TABLE_TOP, slice(max(0, edge - round(SETTLED * s.scenario.frame_rate)), edge)
    slip = velocity[last, 0] - radius * r.angular_velocity[last, ball, 1]
    path, drop = float(velocity[last, 0].sum()), float(place[0, 2] - place[-1, 2])
    share, single = abs(float(slip.sum()) / path), float(np.abs(slip / velocity[last, 0]).max())
    text = f"the ball crosses the edge after {r.time[edge]:.2f} s at {velocity[edge, 0]:.2f} m/s and falls "
    text += f"by {drop:.2f} m; its turn differs from its path by {percent(share)}, "
    text += f"in frames by {percent(single)}"
    return Ruling(share, ROLLING, "1", text, "it slides, or does not fall", drop >= FALLEN)


@claim("wall", "figure 2", "An avatar moves into a wall: the extended arm and a leg are pushed back.",
       "poses", ("wall_push",), ">=")  # fmt: skip
def pushed_back(scenes: Scenes) -> Ruling:
    """Trackers of hand and foot are PUSHED deep in the wall, and what is shown does not overlap it."""
    s = scenes["wall_push"]
    wall, links = s.scenario.body_index("east_wall"), ("right_hand", "left_foot")
    tracked, shown = tracked_depths(s.scenario), Context(s.recording, s.scenario).distances.distance
    pairs = [(min(wall, k), max(wall, k)) for k in map(s.scenario.body_index, links)]
    depths = [float(tracked[pair].max()) for pair in pairs]
    overlap = max(0.0, *(float(-shown[pair].min()) for pair in pairs))
    parts = ", ".join(f"{name} {100 * depth:.0f} cm" for name, depth in zip(links, depths))
    text = f"trackers reach into the wall ({parts}); the shown limbs overlap it by at most {overlap:.1e} m"
    return Ruling(min(depths), PUSHED, "m", text, "a limb enters, or is not pushed", overlap <= RESOLVED)


@claim("jumps", "figure 5", "Objects are separated without visual jumps or artifacts.", "poses", SCENES, "<=")
def jumps(scenes: Scenes) -> Ruling:
    """No link moves in a frame by more than JUMP beyond what its tracker does."""
    found = {n: largest_jump(s) for n, s in scenes.items()}
    text = "largest way of a link in a frame beyond its tracker's own: "
    text += ", ".join(f"{n} {1e3 * way:.0f} mm" for n, (way, _) in found.items())
    way, link = max(found.values())
    return Ruling(way, JUMP, "m", text, f"largest: {link}")


def largest_jump(s: Series) -> tuple[float, str]:
    """Largest way of a link between two frames beyond its tracker's own [m], with the link and the time."""
    best = (-inf, "")
    for tracker in s.scenario.trackers:
        links = list(s.scenario.links(tracker))
        wanted, _ = tracked_poses(s.scenario, tracker, s.recording.time)
        paths = (s.recording.position[:, links], wanted)
        shown, own = (np.linalg.norm(np.diff(path, axis=0), axis=2) for path in paths)
        frame, link = np.unravel_index((shown - own).argmax(), shown.shape)
        name = f"{s.scenario.bodies[links[link]].name} at {s.recording.time[frame + 1]:.2f} s"
        best = max(best, (float((shown - own)[frame, link]), name))
    return best


STUDY, ENGINE, PROFILE = "paper", "reference", "paper"
SETTINGS = Settings(PROFILE, ENGINES[ENGINE].profiles[PROFILE], effects=PLANNED)
COLUMN = (ENGINE, SETTINGS.label, SETTINGS.dt)
CLAIM, REPRODUCED, NOT_REPRODUCED = f"{STUDY}.claim", "reproduced", "not reproduced"


def steps(repeats: int) -> int:
    """Number of progress steps of a run: plays of scenes, one of each untimed."""
    return len(SCENES) * (1 + repeats)


def run(repeats: int, out: Path, progress: Progress, engine: Engine | None = None) -> pd.DataFrame:
    """Play, judge and store; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        scenes, failures = played(engine or load(ENGINE), repeats, progress)
        rows = [
            Row(STUDY, name, *COLUMN, f"{STUDY}.{metric}", value, unit, subject)
            for name, series in scenes.items()
            for metric, subject, unit, value in _figures(series)
        ]
        rows = [*failures, *rows, *rows_of_claims(scenes)]
        facts = {"study": STUDY, "scenes": list(scenes), "repeats": repeats}
        pictures = {f"paper.{kind}": partial(draw_of, scenes, kind) for kind in ("png", "svg")}
        return kept(rows, folder, facts, pictures)


def played(engine: Engine, repeats: int, progress: Progress) -> tuple[Scenes, list[Row]]:
    """Series of every scene, in the order of the mean frame; rows of those that failed."""
    chosen = {name: catalogue()[name] for name in SCENES}
    plays: dict[str, list[Recording]] = {name: [] for name in chosen}
    failures: dict[str, Row] = {}
    for turn in range(1 + repeats):
        for name, scenario in chosen.items():
            progress(f"play {turn} of {repeats}", 1)
            if name in failures:
                continue
            try:
                recording = record(engine, scenario, SETTINGS)
            except AdapterError as error:
                failures[name] = Row(STUDY, name, *COLUMN, "run", verdict="error", reason=str(error))
                continue
            if turn:
                plays[name].append(recording)
    found = [series_of(one, plays[name]) for name, one in chosen.items() if name not in failures]
    found.sort(key=lambda series: float(series.frame.mean()))
    return {series.scenario.name: series for series in found}, list(failures.values())


def _figures(series: Series) -> list[tuple[str, str, str, float]]:
    """Times, shares and work of a scene; means of work over the frames that have any."""
    frame = series.frame
    found = [
        ("frame", "mean", "s", float(frame.mean())),
        ("frame", "median", "s", float(np.median(frame))),
        ("frame", "p95", "s", float(np.percentile(frame, 95))),
        ("rate", "p95", "1/s", 1 / float(np.percentile(frame, 95))),
        *(("share", stage, "1", series.share(stage)) for stage in series.stages),
    ]
    for metric, counter in (("passes", PASSES), ("joints", JOINTS), ("pairs", PAIRS)):
        counts = series.counts[counter]
        found.append((metric, "mean", "1", float(counts[counts > 0].mean()) if counts.any() else 0.0))
        found.append((metric, "peak", "1", float(counts.max())))
    return found


def rows_of_claims(scenes: Scenes) -> list[Row]:
    """A row per claim: the deciding value with its bound, the outcome, and the evidence."""
    found = []
    for claim in CLAIMS:
        key = (STUDY, ", ".join(claim.scenes), *COLUMN, CLAIM)
        missing = [name for name in claim.scenes if name not in scenes]
        if missing:
            reason = f"not played: {', '.join(missing)}"
            found.append(Row(*key, subject=claim.name, verdict="skipped", reason=reason))
            continue
        value, bound, unit, evidence, why, _ = finding = claim.rule(scenes)
        holds = claim.holds(finding)
        code, why_not = (REPRODUCED, "") if holds else (NOT_REPRODUCED, f". Why: {why}")
        row = Row(*key, value, unit, claim.name, limit=bound, basis=claim.basis)
        found.append(replace(row, reason=evidence + why_not, reason_code=code))
    return found


HEADS = (
    *("scene", "mean\n[µs]", "median\n[µs]", "p95\n[µs]", "colli-\nsion", "IK,\nremoval"),
    *("CCD passes\nmean", "\npeak", "joints\nmean", "pairs\nmean", "\npeak", "frames/s\nat p95"),
)
NOTES = (
    "in the order of the mean frame; shares of all stages; removal: of overlap, with IK, without detection;",
    "means of passes, joints and pairs are per frame, over the frames that have any",
)
CLAIM_NOTE = "rests on: counts and poses repeat exactly, times do not; with the deciding value and its bound"
VERDICT_STYLES = {REPRODUCED: "", NOT_REPRODUCED: "yellow"}


def report(frame: pd.DataFrame) -> list[Part]:
    """A line per scene, every claim with its evidence, and scenes that failed."""
    values = {(row.scenario, row.metric, row.subject): row.value for row in rows_of(frame)}
    scenes = [
        [name, *_cells({key[1:]: value for key, value in values.items() if key[0] == name})]
        for name in dict.fromkeys(frame[frame.metric == "paper.rate"].scenario)
    ]
    claims: list[list[str | Text]] = []
    texts = {claim.name: claim for claim in CLAIMS}
    judged = rows_of(frame[frame.metric == CLAIM])
    for row in judged:
        claim, verdict = texts[row.subject], row.reason_code or row.verdict
        unit = "" if row.unit == "1" else f" {row.unit}"
        bound = f"{exact_number(row.value)} {claim.relation} {exact_number(row.limit)}{unit}"
        text = Text.assemble(claim.text, " ", (f"({claim.place})", "dim"))
        basis = Text.assemble(row.basis, "\n", (bound if row.reason_code else "", "dim"))
        claims += [[text, row.reason, basis, Text(verdict, style=VERDICT_STYLES.get(verdict, "dim"))], []]
    count = sum(row.reason_code == REPRODUCED for row in judged)
    heads = ("claim", "measured", "rests on", "verdict")
    told = f"{count} of {len(judged)} claims are reproduced"
    return [
        Part("paper: cost of a frame on the reference's profile `paper`", HEADS, scenes, NOTES),
        Part("paper: what it claims", heads, claims, [CLAIM_NOTE], [told], words=0, last=4),
        failures(frame[frame.verdict == "error"]),
    ]


def _cells(mine: dict[tuple[str, str], float]) -> list[str]:
    def of(metric: str, subject: str) -> float:
        return mine[f"paper.{metric}", subject]

    return [
        *(exact_number(1e6 * of("frame", subject)) for subject in ("mean", "median", "p95")),
        *(f"{100 * of('share', stage):.0f} %" for stage in (COLLISION, REMOVAL)),
        *(f"{of('passes', 'mean'):.1f}", f"{of('passes', 'peak'):.0f}", f"{of('joints', 'mean'):.1f}"),
        *(f"{of('pairs', 'mean'):.1f}", f"{of('pairs', 'peak'):.0f}", f"{of('rate', 'p95'):,.0f}"),
    ]


LINE, WORK, SHADE = "#0072B2", "#D55E00", "#EBEBEB"
STAGES = {
    COLLISION: ("collision detection", "#0072B2", "white"),
    REMOVAL: ("overlap removal with IK", "#D55E00", "white"),
    "drive": ("tracking and attraction", "#E69F00", INK),
    "impulses": ("impulses", "#009E73", "white"),
    "integration": ("integration", "#C9C9C9", INK),
}
"""Label, colour (of Okabe and Ito, safe for colour-blind readers), and that of the number on it."""
LEAST_LABEL = 4.0
"""Least share that has room for its number [%]."""


class Panel(NamedTuple):
    """A scene, its title, the counter below it with its label, and names of the stretches of contact."""

    scene: str
    title: str
    counter: str
    label: str
    contacts: tuple[str, ...]


PANELS = (
    Panel("table_slide", "Figure 7: hand over a table", TESTED, "convex pairs\ntested",
          ("slides\nthere", "slides\nback", "ball")),
    Panel("two_arms", "Figure 8: two arms against a wall", PASSES, "CCD passes",
          ("push 1", "push 2", "push 3")),
)  # fmt: skip


def draw_of(scenes: Scenes, kind: str, _: pd.DataFrame, path: Path) -> None:
    """Draw the frame time over two scenes with contact shaded and the work below, and shares per scene."""
    curves = [_curves(scenes[panel.scene], panel) for panel in PANELS if panel.scene in scenes]
    save(alt.vconcat(alt.hconcat(*curves), _shares(scenes), spacing=24), path, kind=kind)


def _curves(series: Series, panel: Panel) -> Any:
    half = 0.5 / series.scenario.frame_rate
    spans = [(series.time[first] - half, series.time[end - 1] + half) for first, end in series.contacts]
    named = panel.contacts if len(spans) == len(panel.contacts) else [""] * len(spans)
    rows = [(*span, sum(span) / 2, name) for span, name in zip(spans, named)]
    shaded = alt.Chart(pd.DataFrame(rows, columns=["start", "end", "time", "name"]))
    bands = shaded.mark_rect(color=SHADE).encode(x="start:Q", x2="end:Q")
    names = shaded.mark_text(baseline="top", lineBreak="\n", color=INK)
    counts, whole = series.counts[panel.counter], (0, series.time[-1])
    base = alt.Chart(pd.DataFrame({"time": series.time, "frame": 1e6 * series.frame, "work": counts}))
    time = bands + base.mark_line(color=LINE, strokeWidth=1.1).encode(
        x=axis(alt.X, "time", None, whole, labels=False, grid=False),
        y=axis(alt.Y, "frame", "frame time [µs]", (0, 1.2e6 * series.frame.max())),
    )
    time += names.encode(x="time:Q", y=alt.value(2), text="name:N")
    edge = {"color": WORK, "strokeWidth": 1.1}
    work = bands + base.mark_area(interpolate="step", color=WORK, opacity=0.3, line=edge).encode(
        x=axis(alt.X, "time", "time in the scene [s]; shaded: contact", whole, grid=False, tickCount=8),
        y=alt.Y("work:Q", axis=alt.Axis(title=panel.label.split("\n"), tickCount=4, tickMinStep=1)),
    )
    time = time.properties(title=f"{panel.title} ({panel.scene})", width=340, height=170)
    return time & work.properties(width=340, height=80)


def _shares(scenes: Scenes) -> Any:
    rows = [
        (f"{name}  {1e6 * series.frame.mean():.0f} µs", STAGES[stage][0], 100 * series.share(stage), order)
        for name, series in scenes.items()
        for order, stage in enumerate(STAGES)
        if stage in series.stages
    ]
    table = pd.DataFrame(rows, columns=["scene", "stage", "share", "order"])
    table["text"] = table["share"].map("{:.0f}".format).where(table["share"] >= LEAST_LABEL, "")
    names, colors, inks = zip(*STAGES.values())
    table["ink"] = table.stage.map(dict(zip(names, inks)))
    x = axis(alt.X, "share", "share of the time of all frames [%]", (0, 100), grid=False).stack("zero")
    y = alt.Y("scene:N", sort=None, title=None, axis=alt.Axis(ticks=False, domain=False))
    base = alt.Chart(table).encode(x=x, y=y, order="order:Q")
    bars = base.mark_bar(stroke="white").encode(color=by(alt.Color, "stage", dict(zip(names, colors))))
    ink = alt.Color("ink:N", scale=None)
    texts = base.mark_text().encode(x=x.bandPosition(0.5), text="text:N", color=ink)
    title = "Stages per scene, in the order of the mean frame (beside the names)"
    return (bars + texts).properties(title=title, width=600, height=alt.Step(20))
