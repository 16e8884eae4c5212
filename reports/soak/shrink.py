"""Shrinking of a scene that fails to the smallest one that still fails in the same way."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from touchstone.scenarios.scenario import TRACKED, PairCoefficients, Scenario, ScenarioError

Fails = Callable[[Scenario], bool]
MOST_TRIES = 200
"""Largest number of scenes that are played to shrink one."""


def shrunk(scenario: Scenario, fails: Fails, most: int = MOST_TRIES) -> Scenario:
    """Smallest scene found that still fails: fewer bodies, less time, no driver, friction, bounce or spin.

    Args:
        fails: whether a scene fails in the same way; it is called at most `most` times.
    """
    left = most
    found = _bare(scenario)
    better = True
    while better and left > 0:
        better = False
        for smaller in _smaller(found):
            if left == 0:
                break
            left -= 1
            if fails(smaller):
                found, better = smaller, True
                break
    return found


def _bare(scenario: Scenario) -> Scenario:
    return replace(scenario, truths=(), forces=(), published=(), expectations=())


def _smaller(scenario: Scenario) -> Iterator[Scenario]:
    """Simpler scenes, those that leave out most first; only valid ones."""
    for change in (*_without_bodies(scenario), *_shorter(scenario), *_simpler(scenario)):
        try:
            yield change()
        except ScenarioError:
            continue


def _without_bodies(scenario: Scenario) -> Iterator[Callable[[], Scenario]]:
    """Scenes without a driver, without half of the loose bodies, or without one body."""
    if scenario.trackers:
        loose = tuple(body for body in scenario.bodies if body.kind not in TRACKED)
        yield lambda: replace(scenario, bodies=loose, joints=(), trackers=(), chains=())
    names = [body.name for body in scenario.bodies if body.kind not in TRACKED]
    half = len(names) // 2
    groups = [names[:half], names[half:]] if half > 1 else []
    for group in (*groups, *([name] for name in names)):
        rest = tuple(body for body in scenario.bodies if body.name not in group)
        if any(body.kind != "fixed" for body in rest):
            yield lambda rest=rest: replace(scenario, bodies=rest)  # type: ignore[misc]


def _shorter(scenario: Scenario) -> Iterator[Callable[[], Scenario]]:
    frames = scenario.frame_count
    for fewer in dict.fromkeys((frames // 2, frames * 3 // 4, frames - 1)):
        if 0 < fewer < frames:
            yield lambda fewer=fewer: replace(scenario, duration=fewer / scenario.frame_rate)  # type: ignore[misc]


def _simpler(scenario: Scenario) -> Iterator[Callable[[], Scenario]]:
    """Scenes without friction, bounce, gravity or the spin of a body."""
    for e, mu in ((True, False), (False, True)):
        pairs = tuple(
            PairCoefficients(
                one.material_a, one.material_b, one.restitution if e else 0.0, one.friction if mu else 0.0
            )
            for one in scenario.coefficients
        )
        if pairs != scenario.coefficients:
            yield lambda pairs=pairs: replace(scenario, coefficients=pairs)  # type: ignore[misc]
    if "gravity" in scenario.effects:
        effects = tuple(effect for effect in scenario.effects if effect != "gravity")
        yield lambda: replace(scenario, effects=effects)
    for field in ("angular_velocity", "linear_velocity"):
        still = tuple(
            replace(body, **{field: (0.0, 0.0, 0.0)}) if body.kind == "simulated" else body  # type: ignore[arg-type]
            for body in scenario.bodies
        )
        if still != scenario.bodies:
            yield lambda still=still: replace(scenario, bodies=still)  # type: ignore[misc]
