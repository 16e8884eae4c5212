"""The soak: random scenes of consecutive seeds, each judged by all invariants, until the time is up.

A run breaks an invariant if it is not finite, explodes, hangs, passes through something, overlaps, gains
energy or loses momentum beyond what the reference guarantees (`verdict.outcomes.EXACT`). A residual
that the reference itself reports is counted, and is no failure.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count
from pathlib import Path
from time import monotonic

from touchstone.adapters.contract import Settings
from touchstone.adapters.registry import ENGINES, load
from touchstone.adapters.workers.pool import EngineProcess, Loader, Pool, Slot
from touchstone.reports.results import write_text
from touchstone.reports.runner.tasks import Task
from touchstone.reports.studies.robustness import PATIENCE, assess_task, assessment_of
from touchstone.reports.verdict.outcomes import Assessment
from touchstone.scenarios.body_joints import WORLD
from touchstone.scenarios.files.write import scene_toml
from touchstone.scenarios.plural import plural
from touchstone.scenarios.random_scenes import random_scene
from touchstone.scenarios.scenario import TRACKED, Body, BodyJoint, Scenario, ScenarioError

Fails = Callable[[Scenario], bool]
MOST_TRIES = 200


def shrunk(scenario: Scenario, fails: Fails, most: int = MOST_TRIES) -> Scenario:
    """Smallest scene found that still fails: fewer bodies and joints, less time, no driver, friction or spin.

    Args:
        fails: whether a scene fails in the same way; it is called at most `most` times.
    """
    left = most
    found = replace(scenario, truths=(), forces=(), published=(), expectations=())
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
        yield lambda: replace(_with(scenario, loose), joints=(), trackers=(), chains=())
    names = [body.name for body in scenario.bodies if body.kind not in TRACKED]
    half = len(names) // 2
    groups = [names[:half], names[half:]] if half > 1 else []
    for group in (*groups, *([name] for name in names)):
        rest = tuple(body for body in scenario.bodies if body.name not in group)
        if any(body.kind != "fixed" for body in rest):
            yield lambda rest=rest: _with(scenario, rest)  # type: ignore[misc]


def _with(scenario: Scenario, bodies: tuple[Body, ...]) -> Scenario:
    names = {WORLD, *(body.name for body in bodies)}
    kept = tuple(joint for joint in scenario.body_joints if {joint.parent, joint.child} <= names)
    return replace(scenario, bodies=bodies, body_joints=kept)


def _shorter(scenario: Scenario) -> Iterator[Callable[[], Scenario]]:
    frames = scenario.frame_count
    for fewer in dict.fromkeys((frames // 2, frames * 3 // 4, frames - 1)):
        if 0 < fewer < frames:
            yield lambda fewer=fewer: replace(scenario, duration=fewer / scenario.frame_rate)  # type: ignore[misc]


def _simpler(scenario: Scenario) -> Iterator[Callable[[], Scenario]]:
    """Scenes without friction, bounce, gravity, the spin of a body, a joint or its springs and limits."""
    for k, joint in enumerate(scenario.body_joints):
        others = scenario.body_joints[:k], scenario.body_joints[k + 1 :]
        plain = BodyJoint(joint.name, joint.type, joint.parent, joint.child, joint.anchor, joint.axis)
        for own in ((), (plain,)) if plain != joint else ((),):
            joints = (*others[0], *own, *others[1])
            yield lambda joints=joints: replace(scenario, body_joints=joints)  # type: ignore[misc]
    for e, mu in ((True, False), (False, True)):
        known = scenario.coefficients
        pairs = tuple(replace(c, restitution=e * c.restitution, friction=mu * c.friction) for c in known)
        if pairs != scenario.coefficients:
            yield lambda pairs=pairs: replace(scenario, coefficients=pairs)  # type: ignore[misc]
    if "gravity" in scenario.effects:
        effects = tuple(effect for effect in scenario.effects if effect != "gravity")
        yield lambda: replace(scenario, effects=effects)
    for name in ("angular_velocity", "linear_velocity"):
        still = tuple(
            replace(body, **{name: (0.0, 0.0, 0.0)}) if body.kind == "simulated" else body  # type: ignore[arg-type]
            for body in scenario.bodies
        )
        if still != scenario.bodies:
            yield lambda still=still: replace(scenario, bodies=still)  # type: ignore[misc]


ENGINE = "reference"
SOUND = ("ok", "skipped", "residual")
PROCESSES = 2
Listener = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Failure:
    """A broken invariant: its seed, class and reason, the file of the smallest scene, and the command."""

    seed: int
    outcome: str
    reason: str
    bodies: int
    file: Path
    command: str


@dataclass(slots=True)
class Soaked:
    """What was played: scenes, displayed frames, classes, and failures."""

    scenes: int = 0
    frames: int = 0
    classes: Counter[str] = field(default_factory=Counter)
    failures: list[Failure] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Extent:
    """How long a soak lasts: minutes after which no scene is started, first seed, largest number of scenes
    (None: only the time counts), and largest number of scenes that are played to shrink one."""

    minutes: float
    seed: int = 0
    most: int | None = None
    tries: int = MOST_TRIES


def soak(
    extent: Extent,
    profile: str,
    folder: Path,
    tell: Listener,
    loader: Loader = load,
    scene: Callable[[int], Scenario] = random_scene,
) -> Soaked:
    """Play random scenes of consecutive seeds.

    Args:
        folder: where scenes of failures are written, as they are found.
        tell: receives one line per failure.
    """
    folder.mkdir(parents=True, exist_ok=True)
    found = Soaked()
    settings = Settings(profile, ENGINES[ENGINE].profiles[profile])

    def one(slot: Slot[EngineProcess], seed: int) -> Iterator[Assessment | Failure]:
        def played(scenario: Scenario) -> Assessment:
            return assessment_of(slot.child().ask("play", Task(scenario, ENGINE, settings)))

        def fails(scenario: Scenario) -> bool:
            return played(scenario).outcome == first.outcome

        scenario = scene(seed)
        first = played(scenario)
        yield first
        if first.outcome not in SOUND:
            yield _written(shrunk(scenario, fails, extent.tries), seed, first, profile, folder)

    start = partial(EngineProcess, assess_task, loader=loader, patience=PATIENCE)
    for result in Pool(start, PROCESSES, folder).each(_seeds(extent), one):
        if isinstance(result, Failure):
            found.failures.append(result)
            tell(
                f"{result.outcome}: seed {result.seed}, {plural(result.bodies, 'body')} left: "
                f"{result.command}"
            )
        else:
            found.scenes += 1
            found.frames += result.frames
            found.classes[result.outcome] += 1
    return found


def _seeds(extent: Extent) -> Iterator[int]:
    end = monotonic() + 60 * extent.minutes
    for seed in count(extent.seed):
        if monotonic() >= end or (extent.most is not None and seed >= extent.seed + extent.most):
            return
        yield seed


def _written(scenario: Scenario, seed: int, first: Assessment, profile: str, folder: Path) -> Failure:
    """Write the smallest scene as a file that replays it."""
    name = f"soak_{seed}_{first.outcome.replace(' ', '_')}"
    named = replace(scenario, name=name, tags=("soak", *scenario.tags))
    path = folder / f"{name}.toml"
    command = f"touchstone run {path} --engine {ENGINE} --profile {profile}"
    comment = f"{first.outcome}: {first.reason or 'breaks an invariant'}\nshrunk from seed {seed}\n{command}"
    write_text(path, scene_toml(named, comment))
    return Failure(seed, first.outcome, first.reason, len(scenario.bodies), path, command)
