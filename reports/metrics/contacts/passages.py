"""Passages: a piece is apart from another, or touches it, on one side and later again on the other side.

Passages are computed from the poses of the frames, not from the engine's contacts. A body that ends inside
another has not passed it; nor has one that bounces within a frame, grazes, or goes round an edge. Where the
deep part lies between two frames, the path is unknown; it counts as a passage only if

- the bodies are too slow to have gone round, or
- the velocities before lead in on one side and the velocities after lead back in on the other, each as deep
  as a passage, or
- only the velocities before lead in so deep, and the engine reports no contact.

Reported contacts hide no passage that the first two conditions prove. The last two prove nothing if the spin
of a piece that is no ball changed within the frame: it tumbles or was struck, so its orientation on the way
is unknown. Nor do they if a body moved otherwise than one change of its velocity explains: others struck it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, floor, hypot

import numpy as np

from touchstone.reports.metrics.contacts.swept_boxes import Motions, Pair, Sample, Step
from touchstone.reports.metrics.contacts.swept_pairs import LARGE_TURN, SweptPairs
from touchstone.reports.metrics.context import Context, judging

THROUGH = 0.5
"""Least depth of a passage over the sum of both pieces' inner radii [1]; shallower contact is a graze. A ball
that passes another's centre within half the sum of their radii reaches this depth."""
ENTERED = 0.25
"""Depth over the same sum at which the sides of entry and exit are determined [1]."""
TOUCHING = 1 / 64
"""Depth over the same sum up to which pieces count as apart [1]: a body on a table touches it."""
LANDING = 1 / 64
"""Tolerance of a sample at ENTERED, over the same sum [1]: sampling reaches that level up to rounding."""
SPARE = 1.001
"""Factor by which rounding may lengthen a path [1]."""


@dataclass(frozen=True, slots=True)
class Passage:
    """A body (by index) that passed through another, and the time of the middle of the passage [s]."""

    a: int
    b: int
    time: float


def passages(context: Context) -> list[Passage]:
    """All passages of a recording in order of time; pieces of two bodies that pass together count once.

    Raises JudgeMissing where the overlap oracle cannot be imported.
    """
    with judging():
        import touchstone.adapters.oracles.overlap  # noqa: F401
    motions = Motions(context)
    found: list[tuple[float, float, Passage]] = []
    for pair, steps in SweptPairs(context, motions).pairs(THROUGH):
        for start, end, middle in _through(context, pair, set(steps.tolist())):
            found.append((start, end, Passage(*pair.bodies, middle * context.frame)))
    kept: list[tuple[float, float, Passage]] = []
    for start, end, passage in sorted(found, key=lambda row: row[2].time):
        same = (k for k in kept if (k[2].a, k[2].b) == (passage.a, passage.b))
        if not any(start <= k[1] and k[0] <= end for k in same):
            kept.append((start, end, passage))
    return [passage for _, _, passage in kept]


def _through(context: Context, pair: Pair, steps: set[int]) -> Iterator[tuple[float, float, float]]:
    """Start, end and middle [frames] of every passage of a pair that can be deep in those steps."""
    level = -ENTERED * pair.thickness
    for samples in _encounters(pair, steps, level):
        inside = [sample for sample in samples if sample.distance <= level + LANDING * pair.thickness]
        deepest = min(samples, key=lambda sample: sample.distance)
        if not inside or deepest.distance > -THROUGH * pair.thickness:
            continue
        if inside[0].normal @ inside[-1].normal >= 0:
            continue
        recorded = any(sample.time == floor(sample.time) for sample in inside)
        if recorded or _sure(context, pair, floor(deepest.time), deepest):
            yield samples[0].time, samples[-1].time, deepest.time


def _encounters(pair: Pair, steps: set[int], level: float) -> Iterator[list[Sample]]:
    """Samples of a pair between two successive moments of separation, where a step in between can be deep."""
    last, touching = len(pair.motions.rotation) - 1, -TOUCHING * pair.thickness
    done = 0
    for step in sorted(steps):
        if step < done:
            continue
        first, done = step, step + 1
        while first > 0 and pair.at_frame(first).distance <= touching:
            first -= 1
        while done < last and pair.at_frame(done).distance <= touching:
            done += 1
        samples: list[Sample] = []
        for k in range(first, done):
            samples += pair.samples(pair.chords(k), level, float(k)) if k in steps else [pair.at_frame(k)]
        samples.append(pair.at_frame(done))
        apart = [k for k, sample in enumerate(samples) if sample.distance > touching]
        for one, two in pairwise(apart):
            if two > one + 1:
                yield samples[one : two + 1]


def _sure(context: Context, pair: Pair, frame: int, deepest: Sample) -> bool:
    """Whether the bodies certainly passed through each other between two frames in which they are apart."""
    if _cannot_go_round(context, pair, frame, deepest):
        return True
    motions, (a, b) = pair.motions, pair.bodies
    if any(motions.spun(body, frame) > LARGE_TURN for body in pair.sided):
        return False
    if any(_struck_often(context, pair, body, frame) for body in pair.bodies):
        return False
    before = _entry(pair, (motions.onward(a, frame), motions.onward(b, frame)))
    if before is None:
        return False
    after = _entry(pair, (motions.backward(a, frame + 1), motions.backward(b, frame + 1)))
    if after is not None:
        return bool(before.normal @ after.normal < 0)
    rows = context.recording.contacts
    reported = (rows["body_a"] == a) & (rows["body_b"] == b) & (context.contact_frame == frame)
    return not reported.any()


def _struck_often(context: Context, pair: Pair, body: int, frame: int) -> bool:
    """Whether no single change of a body's velocity in a frame explains its displacement, within half of both
    pieces and the fall of a frame: its path is unknown."""
    motions = pair.motions
    way, before = motions.chord(body, frame).way, motions.onward(body, frame).way
    change = motions.onward(body, frame + 1).way - before
    square = float(change @ change)
    share = float(np.clip((way - before) @ change / square, 0.0, 1.0)) if square > 0 else 0.0
    fall = float(np.linalg.norm(context.gravity)) * context.frame**2
    return float(np.linalg.norm(way - before - share * change)) > THROUGH * pair.thickness + fall


def _entry(pair: Pair, steps: tuple[Step, Step]) -> Sample | None:
    """The sample at which the pair enters, along steps of both bodies; None if they graze at most."""
    level = -ENTERED * pair.thickness
    inside = [sample for sample in pair.samples(steps, level) if sample.distance <= level]
    deepest = min((sample.distance for sample in inside), default=0.0)
    return inside[0] if deepest <= -THROUGH * pair.thickness else None


def _cannot_go_round(context: Context, pair: Pair, frame: int, deepest: Sample) -> bool:
    """Whether a path round the obstacle is longer than the bodies' speeds allow.

    Such a path passes the deepest point of the chord at a distance of at least the depth there. Paths are
    those of A's material at that point, relative to B. Where contacts change the spin of a piece within the
    frame, its chord says little of the path.
    """
    motions, steps, share = pair.motions, pair.chords(frame), deepest.time - frame
    if any(motions.spun(body, frame) > LARGE_TURN for body in pair.sided):
        return False
    _, point = pair.sample(steps, share, deepest.time)
    locals_ = []
    for body, step in zip(pair.bodies, steps):
        turned, origin = motions.pose(body, step, share)
        locals_.append(turned.T @ (point - origin))
    seen, speeds = [], []
    for moment in (0.0, share, 1.0):
        (turn_a, origin_a), (turn_b, origin_b) = (
            motions.pose(body, step, moment) for body, step in zip(pair.bodies, steps)
        )
        place = turn_a @ locals_[0] + origin_a
        seen.append(turn_b.T @ (place - origin_b))
        if moment in (0.0, 1.0):
            at = frame + ceil(moment)
            one, two = (motions.point_velocity(body, at, place) for body in pair.bodies)
            speeds.append(float(np.linalg.norm(one - two)))
    ahead, rest = (float(np.linalg.norm(y - x)) for x, y in pairwise(seen))
    fastest = max(speeds) + float(np.linalg.norm(context.gravity)) * context.frame
    budget = max(fastest * context.frame, ahead + rest) * SPARE
    return hypot(ahead, deepest.distance) + hypot(rest, deepest.distance) > budget
