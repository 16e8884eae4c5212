"""Bodies that driven plates press, hold, lift and drag: the coupling's force and friction carry them."""

from dataclasses import replace
from math import sqrt

import numpy as np

from touchstone.scenarios.avatar.tracking import ease, keyframed
from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import (
    GRAVITY,
    Arc,
    Body,
    Expectation,
    PairCoefficients,
    Scenario,
    Tracker,
    Truth,
    Vector,
)
from touchstone.scenarios.solids import block, slab
from touchstone.scenarios.truths.force_truth import ForceTruth
from touchstone.scenarios.truths.published import Published

TAGS = ("driven",)
STIFFNESS, MASS = 2000.0, 0.5
"""Coupling [N/m] and mass [kg] of a plate; critically damped."""
PLATE = (0.01, 0.03, 0.03)
"""Half extents of a plate that holds a cube from the side [m]."""
CUBE, WEIGHT = 0.02, 0.1
"""Half extent [m] and mass [kg] of the cube."""
MU, SLIPPERY = 0.7, 0.3
"""Friction of a plate on what it holds, and of a body on the ground [1]."""
FRAME_RATE = 60

CREEP = (
    "Coulomb (1785): what sticks rests; issue 3328 of google-deepmind/mujoco (2026): grips of 20 to 95 times "
    "the weight creep at 50 to 2,300 um/s. Tolerance 10 um in 2 s: a tenth of the least of that"
)


@scene
def press() -> Scenario:
    """A plate whose tracker is 10 mm inside a box presses with 20 N; the box stays."""
    half, box = (0.03, 0.03, 0.02), (0.1, 0.1, 0.05)
    above = 2 * box[2] + half[2]
    times, close = _keyframes(1.5, 0.1, 0.3)
    path = [(0.0, 0.0, above + 0.005 - 0.015 * s) for s in close]
    return _scene(
        "press",
        "a driven plate presses a box with 20 N",
        (slab("ground", "wood"), _plate("plate", half), block("box", "pad", box, 1.0, (0.0, 0.0, box[2]))),
        (_tracker("plate", times, path),),
        truths=(Truth("box", "arcs", (Arc(0.0, (0.0, 0.0, box[2])),)),),
        forces=(
            ForceTruth("plate", "box", 1.0, 1.5, 0.01 * STIFFNESS),
            ForceTruth("ground", "box", 1.0, 1.5, 0.01 * STIFFNESS + GRAVITY),
        ),
    )


@scene
def grip() -> Scenario:
    """Two plates squeeze a cube with 1.5 times the force that just holds it, lift it by 2 cm and hold it."""
    force = 1.5 * WEIGHT * GRAVITY / (2 * MU)
    plain = _lifted(
        "grip", "two plates hold a cube with 1.5 times its weight", force, rise=0.02, duration=4.0
    )
    slip = Published("slip", "cube", "distance", 0.0, 1e-5, CREEP, 2.0, 4.0, other="left")
    return replace(plain, tags=(*plain.tags, "literature"), published=(slip,))


@scene
def lift() -> Scenario:
    """Two plates squeeze a cube with 20 N each and lift it by 0.2 m."""
    return _lifted("lift", "two plates lift a cube by 0.2 m", 20.0, rise=0.2, duration=3.0)


@scene
def drag() -> Scenario:
    """A plate presses a box with 40 N and drags it over the ground, away from a post that it touches."""
    half, box = (0.03, 0.03, 0.02), (0.1, 0.1, 0.05)
    above = 2 * box[2] + half[2]
    times, close = _keyframes(3.0, 0.1, 0.3)
    _, away = _keyframes(3.0, 0.6, 1.5)
    path = [(0.3 * x, 0.0, above + 0.005 - 0.025 * s) for s, x in zip(close, away)]
    post = block("post", "wood", (0.05, 0.1, 0.05), 0.0, (-0.15, 0.0, 0.05), kind="fixed")
    return _scene(
        "drag",
        "a driven plate presses a box with 40 N and drags it by 0.3 m",
        (
            slab("ground", "wood"),
            post,
            _plate("plate", half),
            block("box", "pad", box, 1.0, (0.0, 0.0, box[2])),
        ),
        (_tracker("plate", times, path),),
        expectations=(Expectation("leave", "box", "post", 0.6, 1.6),),
    )


def _lifted(name: str, summary: str, force: float, rise: float, duration: float) -> Scenario:
    """A cube on the ground that two plates squeeze with a force [N] each and lift by `rise` [m]."""
    times, close = _keyframes(duration, 0.1, 0.4)
    _, up = _keyframes(duration, 0.8, 1.0)
    reach, gap = CUBE + PLATE[0], 0.005
    paths = [
        [
            (side * (reach + gap - (gap + force / STIFFNESS) * s), 0.0, CUBE + 0.012 + rise * z)
            for s, z in zip(close, up)
        ]
        for side in (-1, 1)
    ]
    plates = ("left", "right")
    return _scene(
        name,
        summary,
        (
            slab("ground", "wood"),
            block("cube", "pad", (CUBE,) * 3, WEIGHT, (0.0, 0.0, CUBE)),
            *(_plate(plate, PLATE) for plate in plates),
        ),
        tuple(_tracker(plate, times, path) for plate, path in zip(plates, paths)),
        expectations=(Expectation("leave", "cube", "ground", 0.8, 1.6),),
    )


def _keyframes(duration: float, begin: float, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] at the frame rate, and a share that goes smoothly from 0 to 1 in `length` from `begin` on."""
    times = np.arange(round(duration * FRAME_RATE) + 1) / FRAME_RATE
    return times, ease(times, begin, length)


def _plate(name: str, half: Vector) -> Body:
    return block(name, "pad", half, MASS, kind="driven")


def _tracker(root: str, times: np.ndarray, path: list[Vector]) -> Tracker:
    return keyframed(root, times, path, stiffness=STIFFNESS, damping=2 * sqrt(STIFFNESS * MASS))


def _scene(
    name: str,
    summary: str,
    bodies: tuple[Body, ...],
    trackers: tuple[Tracker, ...],
    truths: tuple[Truth, ...] = (),
    expectations: tuple[Expectation, ...] = (),
    forces: tuple[ForceTruth, ...] = (),
) -> Scenario:
    return Scenario(
        name=name,
        summary=summary,
        tags=TAGS,
        bodies=bodies,
        trackers=trackers,
        coefficients=(
            PairCoefficients("wood", "wood", 0.0, SLIPPERY),
            PairCoefficients("wood", "pad", 0.0, SLIPPERY),
            PairCoefficients("pad", "pad", 0.0, MU),
        ),
        duration=trackers[0].times[-1],
        truths=truths,
        expectations=expectations,
        forces=forces,
    )
