"""Loads that slip and stick on shaken platforms, against an integration of their own."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import load
from touchstone.reports.metrics.context import Context
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import (
    GRAVITY,
    IDENTITY,
    Body,
    Box,
    PairCoefficients,
    Piece,
    Scenario,
    Tracker,
)
from touchstone.scenarios.solids import block

Array = NDArray[np.float64]
PROFILES = ("balanced", "accurate")
CREEP = 1e-8
"""Speed at which friction of the integration is 0.7 of its limit [m/s]: it creeps by 1e-8 m."""
FARTHEST = {"across": 2e-3, "lifted": 2e-3, "stacked": 2e-3, "tilted": 5e-3, "both": 1.2e-2}
"""Largest error of a load at 1/60 s over its largest slip [1]: slips turn in the last two."""
FREQUENCIES, OVER = (1.0, 3.0), (1.05, 2.5)
"""Of shakers [1/s], and their largest acceleration over that at which a load sticks [1]."""


def shaken(kind: str, seed: int, rate: int) -> tuple[Scenario, Array, Array]:
    """A random shaken platform with its loads, their masses [kg] and the frictions below them [1]."""
    draw = np.random.default_rng(seed)
    w, mu = 2 * pi * draw.uniform(*FREQUENCIES), draw.uniform(0.15, 0.6)
    size = draw.uniform(*OVER) * mu * GRAVITY / w**2
    second = size * draw.uniform(0.2, 1.0) if kind == "both" else 0.0
    lift = draw.uniform(0.5, 4.0) / (2 * w) ** 2 if kind == "lifted" else 0.0
    lean, way = np.arctan(mu) * draw.uniform(0.1, 0.8) if kind == "tilted" else 0.0, draw.uniform(0, 2 * pi)
    leaning = GRAVITY * np.sin(lean)
    mass = 10 ** draw.uniform(-1, 1, 2 if kind == "stacked" else 1)
    friction = np.array((mu, mu * draw.uniform(0.5, 1.5)))[: len(mass)]
    half = (0.15, draw.uniform(0.1, 0.2), draw.uniform(0.02, 0.05))

    def place(time: float) -> tuple[float, float, float]:
        x = min(1.0, time / 0.3)
        grown = x**3 * (10 - 15 * x + 6 * x * x)
        x, y, z = size * np.cos(w * time), second * np.sin(w * time), lift * np.cos(2 * w * time)
        return float(grown * x), float(grown * y), float(grown * z) - 0.05

    times = np.linspace(0, 1.5, 181).tolist()
    posed = (tuple(times), tuple(map(place, times)), (IDENTITY,) * 181, ((),) * 181)
    names = [f"layer{k}" for k in range(len(mass) + 1)]
    loads = (
        block(f"load{k}", names[k + 1], half, m, (0, 0, (2 * k + 1) * half[2])) for k, m in enumerate(mass)
    )
    platform = Body("platform", "prescribed", names[0], (Piece("platform", Box((1.0, 1.0, 0.05))),))
    pairs = tuple(
        PairCoefficients(one, two, 0.0, friction[min(a, len(mass) - 1)])
        for a, one in enumerate(names)
        for two in names[a + 1 :]
    )
    tracker = Tracker("platform", (), *posed, interpolation="cubic")
    gravity = (leaning * np.cos(way), leaning * np.sin(way), -GRAVITY * np.cos(lean))
    fields = {"trackers": (tracker,), "gravity": gravity, "frame_rate": rate}
    scene = Scenario("shaken", "", (), (platform, *loads), 1.0, pairs, **fields)
    return scene, mass, friction


def integrated(scene: Scenario, mass: Array, friction: Array, times: Array) -> Array:
    """Places of the loads along the platform (times, loads, 2) [m], by Coulomb's law with a little creep."""
    keys = np.array(scene.trackers[0].times)
    path = sample(scene.trackers[0], keys)
    speed = CubicHermiteSpline(keys, path.position, path.linear_velocity).derivative()
    carried, count = np.cumsum(mass[::-1])[::-1], len(mass)
    pull, weight, lifting = scene.gravity[:2], -scene.gravity[2], speed.derivative()

    def rate(time: float, state: Array) -> Array:
        v = state[2 * count :].reshape(count, 2)
        slip = v - np.vstack([speed(time)[:2], v[:-1]])
        limit = friction * carried * (weight + lifting(time)[2])
        force = -(limit / np.sqrt((slip**2).sum(1) + CREEP**2))[:, None] * slip
        force[:-1] -= force[1:]
        return np.concatenate([v.ravel(), (force / mass[:, None] + pull).ravel()])

    start = np.zeros(4 * count)
    found = solve_ivp(
        rate, (0, times[-1]), start, "Radau", times, rtol=1e-7, atol=1e-10, max_step=1 / 240
    )  # fmt: skip
    return found.y[: 2 * count].T.reshape(-1, count, 2)


def error(kind: str, seed: int) -> float:
    """Largest error of a random load at 1/60 s over its largest slip [1]."""
    scene, mass, friction = shaken(kind, seed, 60)
    found = record(load("reference"), scene, Settings("balanced", 1 / 60))
    truth = integrated(scene, mass, friction, found.time)
    slip = np.abs(truth - (found.position[:, :1, :2] - found.position[0, :1, :2])).max()
    return float(np.abs(found.position[:, 1:, :2] - truth).max() / slip)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", FARTHEST)
def test_loads_slip_and_stick_as_integrated(kind: str, seed: int) -> None:
    """Boxes and stacks begin to slide and stop within frames, on platforms shaken along one axis or two."""
    assert error(kind, seed) < FARTHEST[kind]


def errors(name: str, profile: str, rates: tuple[int, ...]) -> tuple[Scenario, list[float]]:
    """A scene, and the largest distance of its load from its truth at each frame rate [m]."""
    scene, found = catalogue()[name], []
    for rate in rates:
        seen = record(load("reference"), replace(scene, frame_rate=rate), Settings(profile, 1 / rate))
        context = Context(seen, scene)
        ((body, truth),) = context.truths.items()
        found.append(float(np.linalg.norm(context.mass_centers[:, body] - truth.position, axis=1).max()))
    return scene, found


@pytest.mark.parametrize("profile", PROFILES)
def test_stick_and_slip_are_events(profile: str) -> None:
    """The load begins to slide and stops within frames: 1e-3 of its slip at 1/60 s, of second order."""
    scene, (coarse, usual, fine) = errors("shaker_stick_slip", profile, (30, 60, 120))
    assert usual < 1e-3 * scene.published[0].value
    assert fine < coarse / 14


@pytest.mark.parametrize("profile", PROFILES)
def test_a_slip_that_reverses_at_once_is_an_event(profile: str) -> None:
    """Across the slope the shaker stops and reverses the slip, sometimes at the very start of a substep."""
    _, (usual, fine) = errors("shaker_across", profile, (60, 120))
    assert usual < 1e-5
    assert fine < 1e-9


@pytest.mark.parametrize("rate", [60, 100, 240])
def test_a_load_leaves_a_platform_where_its_force_ends(rate: int) -> None:
    """A box on a platform that swings up and down by more than gravity flies on where the platform's
    acceleration passes -g, wherever in a step that is."""
    size, w, end = 0.06, 5 * pi, 0.25
    times = np.linspace(0.0, end, 61)
    rise = size * (1 - np.cos(w * times)) - 0.05
    posed = (tuple(times.tolist()), tuple((0.0, 0.0, float(z)) for z in rise), (IDENTITY,) * 61, ((),) * 61)
    platform = Body("platform", "prescribed", "wood", (Piece("platform", Box((1.0, 1.0, 0.05))),))
    tracker = Tracker("platform", (), *posed, interpolation="cubic")
    box, pairs = (
        block("box", "wood", (0.1, 0.1, 0.05), 1.0, (0.0, 0.0, 0.05)),
        (PairCoefficients("wood", "wood", 0.0, 0.3),),
    )
    scene = Scenario("thrown", "", (), (platform, box), end, pairs, trackers=(tracker,), frame_rate=rate)
    leaves = float(np.arccos(-GRAVITY / (size * w**2))) / w
    height, speed, flight = size * (1 - np.cos(w * leaves)), size * w * np.sin(w * leaves), end - leaves
    found = record(load("reference"), scene, Settings("balanced", 1 / rate)).position[-1, 1, 2] - 0.05
    assert found == pytest.approx(height + speed * flight - GRAVITY * flight**2 / 2, abs=2e-5)
