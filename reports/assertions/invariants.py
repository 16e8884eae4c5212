"""Assertions on runs: each measures metrics of `reports/metrics`, judges them by the table of limits, and
raises InvariantError where a limit is broken or nothing could be judged. Two compare two runs of one scene:
the same bits again, and the same motion in another order of bodies.

    recording = touchstone.recording(scenario, position, orientation, velocity, omega, contacts)
    assert_no_overlap(recording)

A run is a recording of this project or of `touchstone.recording`, which holds its scenario. Without `limit`
that of the scene, tag and engine holds, or else that of the probes. All return the measured value.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from math import isnan
from numbers import Real

import numpy as np

from touchstone.adapters.recording import Recording, scene_of_text
from touchstone.adapters.registry import asked_as
from touchstone.reports.assertions.arrays import ARRAYS
from touchstone.reports.assertions.outcome import Finding, InvariantError, Place, settled
from touchstone.reports.metrics import METRICS
from touchstone.reports.metrics.contacts.contact import BOUNCE_SPEED
from touchstone.reports.metrics.contacts.passages import passages
from touchstone.reports.metrics.context import Context, Value, Values
from touchstone.reports.metrics.motion.energy import energy_rise, mechanical_energy
from touchstone.reports.metrics.motion.events import bounces
from touchstone.reports.metrics.solver import STATES
from touchstone.reports.results import Row
from touchstone.reports.runner.request import step_text
from touchstone.reports.verdict.limits import limit_of
from touchstone.reports.verdict.rows import measured_of
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.files.named import argument_of
from touchstone.scenarios.scenario import UNMOVED, Scenario

Locate = Callable[[Context, Values], Place]


def deepest(context: Context, values: Values) -> Place:
    """The pair and the frame of the deepest overlap."""
    distances = context.distances.distance
    pair = min(distances, key=lambda one: float(distances[one].min()))
    return Place(int(distances[pair].argmin()), _names(context, *pair))


def first_passage(context: Context, values: Values) -> Place:
    """The first passage of a body through another."""
    found = passages(context)
    if not found:
        return Place()
    first = found[0]
    return Place(int(first.time / context.frame), _names(context, first.a, first.b), "one through the other")


def largest_rise(context: Context, values: Values) -> Place:
    """The frame in which the energy exceeds its running minimum most, and the body that gained most in it."""
    rises = energy_rise(context)
    subject = max(rises, key=lambda name: float(rises[name].max()))
    rise = rises[subject]
    steepest = int(np.diff(rise, prepend=0.0).argmax())
    before = max(steepest - 1, 0)
    gains = {k: float(np.diff(mechanical_energy(context, [k]))[before]) for k in context.simulated}
    names = _names(context, max(gains, key=lambda k: gains[k])) if gains else ()
    return Place(steepest, names, f"the steepest rise; the largest total is in frame {int(rise.argmax())}")


def largest_jump(context: Context, values: Values) -> Place:
    """The frame in which the total momentum changes most, and the body whose own changes most in it."""
    bodies = context.simulated
    momenta = context.recording.linear_velocity[:, bodies] * context.mass[bodies, None]
    steps = np.linalg.norm(np.diff(momenta.sum(axis=1), axis=0), axis=1)
    frame = int(steps.argmax())
    own = np.linalg.norm(momenta[frame + 1] - momenta[frame], axis=1)
    return Place(frame + 1, _names(context, bodies[int(own.argmax())]), "the largest change")


def worst_contact(context: Context, values: Values) -> Place:
    """The contact whose tangential impulse exceeds the cone most, of the pair that the metric names."""
    rows = context.recording.contacts
    normal, tangential = context.impulses
    excess = np.linalg.norm(tangential, axis=1) - context.friction * np.maximum(normal, 0.0)
    value = values.get("", 0.0)
    named = value.reason.removeprefix("of ") if isinstance(value, Value) else ""
    pairs = [context.pair_name(int(a), int(b)) for a, b in zip(rows["body_a"], rows["body_b"])]
    if named:
        excess = np.where(np.array(pairs) == named, excess, -np.inf)
    k = int(excess.argmax())
    names = _names(context, int(rows[k]["body_a"]), int(rows[k]["body_b"]))
    across, bound = np.linalg.norm(tangential[k]), context.friction[k] * normal[k]
    words = f"|j_t| = {across:.3g} N s, mu j_n = {bound:.3g} N s"
    return Place(int(context.contact_frame[k]) + 1, names, words)


def worst_bounce(context: Context, values: Values) -> Place:
    """The bounce whose restitution differs most from the requested one."""
    worst, place = -1.0, Place()
    for a, b in context.distances.distance:
        asked = context.scenario.pair_coefficients(a, b)[0]
        if not np.isfinite(context.distances.distance[a, b]).all():
            continue
        for bounce in bounces(context, (a, b)):
            off = abs(bounce.restitution - asked)
            if bounce.approach > BOUNCE_SPEED and off > worst:
                words = f"{bounce.restitution:.3f} at {bounce.approach:.2f} m/s, asked {asked:g}"
                frame = int(bounce.time / context.frame) + 1
                worst, place = off, Place(frame, _names(context, a, b), words)
    return place


def unequal_paths(context: Context, values: Values) -> Place:
    """The bodies with the longest and the shortest path among those that differ in their heading."""
    ends = context.mass_centers[-1] - context.mass_centers[0]
    lengths = {
        t.body: float(np.linalg.norm(ends[context.scenario.body_index(t.body)]))
        for t in context.scenario.truths
    }
    far, near = max(lengths, key=lengths.__getitem__), min(lengths, key=lengths.__getitem__)
    remark = f"{lengths[far]:.4g} m and {lengths[near]:.4g} m from their start"
    return Place(len(context.recording.time) - 1, (far, near), remark)


def _names(context: Context, *bodies: int) -> tuple[str, ...]:
    return tuple(context.scenario.bodies[k].name for k in bodies)


ENERGY_SHARE = 0.05
"""Energy that may appear, over the largest kinetic energy of the run [1], where no limit is stated: an
integrator of first order at a fitting step is off by less."""
KEPT = 8
"""Recordings whose distances are kept, so that several assertions on one run measure them once."""
VELOCITIES = ("linear_velocity", "angular_velocity")
AUDITS = ("contact.impulse_balance", "contact.impulse_balance.driven")

_scene_of_text = lru_cache(maxsize=KEPT)(scene_of_text)
_recent: OrderedDict[int, tuple[Recording, Context]] = OrderedDict()


@dataclass(frozen=True, slots=True)
class Invariant:
    """An assertion's metrics (the first must be measured), what it needs, and where its worst value is."""

    metrics: tuple[str, ...]
    locate: Locate
    needs: tuple[str, ...] = ()


INVARIANTS = {
    "no_overlap": Invariant(("overlap.max",), deepest),
    "no_tunnelling": Invariant(("overlap.tunnelled",), first_passage, VELOCITIES),
    "energy_not_created": Invariant(("energy.injected",), largest_rise, VELOCITIES),
    "momentum_kept": Invariant(("momentum.linear", "momentum.angular"), largest_jump, VELOCITIES),
    "friction_cone": Invariant(("friction.cone",), worst_contact, (*VELOCITIES, "contacts")),
    "restitution": Invariant(("restitution.error",), worst_bounce, (*VELOCITIES, "contacts")),
    "heading_independent": Invariant(("friction.heading",), unequal_paths),
}


def assert_no_overlap(run: Recording, scenario: Scenario | None = None, limit: float | None = None) -> float:
    """No two bodies overlap deeper than the limit [m] in any frame, by the overlap oracle."""
    return check("no_overlap", run, scenario, limit)


def assert_no_tunnelling(
    run: Recording, scenario: Scenario | None = None, limit: float | None = None
) -> float:
    """No body passes through another (number of passages)."""
    return check("no_tunnelling", run, scenario, limit)


def assert_energy_not_created(
    run: Recording, scenario: Scenario | None = None, limit: float | None = None
) -> float:
    """K + U less the work of drives never rises by more than the limit [J] (`energy.injected`)."""
    return check("energy_not_created", run, scenario, limit)


def assert_momentum_kept(
    run: Recording, scenario: Scenario | None = None, limit: float | None = None
) -> float:
    """Linear and angular momentum change by no more than the limit [1], in scenes tagged `isolated`."""
    return check("momentum_kept", run, scenario, limit)


def assert_friction_cone(
    run: Recording, scenario: Scenario | None = None, limit: float | None = None
) -> float:
    """Tangential impulses exceed mu times the normal ones by no more than the limit [1], per pair and step.
    The impulses must balance the motion; otherwise they are not judged."""
    return check("friction_cone", run, scenario, limit)


def assert_restitution(run: Recording, scenario: Scenario | None = None, limit: float | None = None) -> float:
    """Central impacts faster than 1 m/s achieve the scenario's restitution to within the limit [1]."""
    return check("restitution", run, scenario, limit)


def assert_heading_independent(
    run: Recording, scenario: Scenario | None = None, limit: float | None = None
) -> float:
    """Paths that differ in heading only are equal to within the limit [1], in scenes tagged `headings`."""
    return check("heading_independent", run, scenario, limit)


def check(
    invariant: str, run: Recording, scenario: Scenario | None = None, limit: float | None = None
) -> float:
    """Measure and judge an invariant of INVARIANTS; returns the value or raises InvariantError, or TypeError
    where the limit is no number."""
    asked = INVARIANTS[invariant]
    if not isinstance(limit, Real | None):
        first = METRICS[asked.metrics[0]]
        raise TypeError(f"limit: found {limit!r}, expected a number, {first.name} in [{first.unit}]")
    context = context_of(run, scenario)
    _require(invariant, asked, context)
    findings = []
    for metric in asked.metrics:
        found = _rows(context, metric)
        rows = [row for row in found if not isnan(row.value)]
        if not rows and metric == asked.metrics[0]:
            reasons = [row.reason for row in found if row.reason]
            raise unjudged(invariant, context, reasons[0] if reasons else "nothing was measured")
        if rows:
            findings.append(_finding(context, asked, rows, limit))
    return settled(tuple(findings))


def context_of(run: Recording, scenario: Scenario | None = None) -> Context:
    """Context of a run's metrics, kept for the last KEPT runs."""
    kept = _recent.get(id(run))
    if kept is not None and kept[0] is run and (scenario is None or kept[1].scenario is scenario):
        _recent.move_to_end(id(run))
        return kept[1]
    context = Context(run, scenario or scenario_of(run))
    _recent[id(run)] = (run, context)
    while len(_recent) > KEPT:
        _recent.popitem(last=False)
    return context


def scenario_of(run: Recording) -> Scenario:
    """The scenario that a recording holds; raises ValueError if it cannot be read."""
    if not isinstance(run, Recording):
        found = type(run).__name__
        raise TypeError(f"expected a recording (touchstone.recording makes one of arrays), found {found}")
    try:
        return _scene_of_text(run.scenario)
    except ValueError as error:
        raise ValueError(f"scenario of the recording: {error}; pass scenario=") from error


def unjudged(invariant: str, context: Context, reason: str) -> InvariantError:
    """The error of an assertion that could not be judged."""
    return InvariantError(f"{source_of(context)}: {invariant} could not be judged: {reason}")


def source_of(context: Context) -> str:
    """Scene, engine, profile and step of a run, in one phrase."""
    facts = context.recording.facts
    parts = [facts["engine"], facts.get("profile", ""), f"step {step_text(float(facts['dt']))} s"]
    return f"{context.scenario.name} ({', '.join(part for part in parts if part)})"


def _require(invariant: str, asked: Invariant, context: Context) -> None:
    """Raise where the run ended before its scene, or lacks what the invariant needs."""
    run = context.recording
    if run.ended:
        raise unjudged(invariant, context, f"the run ended before its scene: {run.ended}")
    for name in asked.needs:
        if name == "contacts":
            absent = run.facts.get("contacts") is False
        else:
            absent = bool(np.isnan(getattr(run, name)).any())
        if absent:
            raise unjudged(invariant, context, f"{name} was not given")


def _rows(context: Context, metric: str) -> list[Row]:
    """Rows of a metric; those that use impulses only after the audit of these."""
    facts = context.recording.facts
    engine = "" if facts["engine"] == ARRAYS else facts["engine"]
    base = Row("assert", context.scenario.name, engine, facts.get("profile", ""), float(facts["dt"]), "run")
    found = measured_of(base, context, (metric,), AUDITS if metric == "friction.cone" else ())
    return [row for row in found if row.metric == metric]


def _finding(context: Context, asked: Invariant, rows: list[Row], limit: float | None) -> Finding:
    worst = max(rows, key=lambda row: abs(row.value))
    largest, reason = (limit, "as given") if limit is not None else _limit(context, worst)
    values: Values = {row.subject: Value(row.value, row.reason) for row in rows}
    broken = not abs(worst.value) <= largest
    place = asked.locate(context, values) if broken else Place()
    time = None if place.frame is None else float(context.recording.time[place.frame])
    found = (worst.metric, worst.value, worst.unit, largest, reason, source_of(context))
    return Finding(*found, place, time, _shown_by(context, worst, place))


def _limit(context: Context, row: Row) -> tuple[float, str]:
    """The limit of a row and its reason: of its scene, tags and engine, or else that of the probes."""
    found = limit_of(row, context.scenario.tags)
    if found is None and row.metric == "energy.injected":
        r, bodies = context.recording, [k for k, kind in enumerate(context.kind) if kind not in UNMOVED]
        speed = r.linear_velocity[:, bodies]
        moving = np.einsum("fni,fni,n->f", speed, speed, context.mass[bodies])
        largest = ENERGY_SHARE * float(moving.max()) / 2
        return largest, f"{ENERGY_SHARE:.0%} of the largest kinetic energy"
    found = found or limit_of(row, (*context.scenario.tags, "probe"))
    if found is None or isnan(found.largest):
        raise unjudged(row.metric, context, "the scene has no limit for it: pass limit=")
    return found.largest, found.reason


def _shown_by(context: Context, row: Row, place: Place) -> str:
    """The command or the expression that shows a value."""
    facts, scene = context.recording.facts, context.scenario.name
    argument = argument_of(scene)
    if facts["engine"] != ARRAYS and (scene in catalogue() or argument != scene):
        column = f"--engine {asked_as(facts['engine'])} --profile {facts['profile']}"
        return f"touchstone run {argument} {column} --metric {row.metric}"
    if place.frame is None or not place.bodies:
        return ""
    indices = [context.scenario.body_index(name) for name in place.bodies]
    return f"the run's position[{place.frame}, {indices}]"


ORDER_TOLERANCE = 1e-6
"""Distance by which bodies may end apart where only their order differs [m]: that at which contacts are
found."""


def assert_deterministic(first: Recording, second: Recording, scenario: Scenario | None = None) -> float:
    """Two runs of one scene are equal to the bit, contacts included; returns 0."""
    context = context_of(first, scenario)
    source = source_of(context)
    _require_ended(first, second, "determinism", source)
    if first.position.shape != second.position.shape:
        raise InvariantError(f"{source}: the runs have {len(first.time)} and {len(second.time)} frames")
    place, worst = Place(), 0.0
    for name in STATES:
        one, two = getattr(first, name), getattr(second, name)
        same = (one == two) | (np.isnan(one) & np.isnan(two))
        if not same.all():
            frame, k = np.argwhere(~same)[0][:2]
            if place.frame is None or frame < place.frame:
                body = () if name.startswith("joint") else (context.scenario.bodies[int(k)].name,)
                place = Place(int(frame), body, f"the first difference, in {name}")
            worst = max(worst, float(np.nanmax(np.abs(one - two))))
    if place.frame is None and not _same_contacts(first, second):
        place, worst = Place(None, (), "the contacts differ"), max(worst, 1.0)
    time = None if place.frame is None else float(first.time[place.frame])
    reason = "equal to the bit"
    return settled((Finding("determinism", worst, "1", 0.0, reason, source, place, time),))


def _same_contacts(first: Recording, second: Recording) -> bool:
    names = first.contacts.dtype.names or ()
    return len(first.contacts) == len(second.contacts) and all(
        np.array_equal(
            first.contacts[name], second.contacts[name], equal_nan=name not in ("body_a", "body_b")
        )
        for name in names
    )


def assert_order_independent(
    first: Recording,
    second: Recording,
    scenario: Scenario | None = None,
    reordered: Scenario | None = None,
    limit: float = ORDER_TOLERANCE,
) -> float:
    """Bodies of the same name move equally, to within the limit [m], in two runs whose scenes differ in the
    order of their bodies only."""
    context, other = context_of(first, scenario), context_of(second, reordered)
    source = source_of(context)
    _require_ended(first, second, "order independence", source)
    names = [body.name for body in context.scenario.bodies]
    theirs = [body.name for body in other.scenario.bodies]
    if sorted(names) != sorted(theirs):
        raise InvariantError(f"{source}: the scenes do not have the same bodies")
    if names == theirs:
        raise InvariantError(f"{source}: order independence could not be judged: the order is the same")
    frames = min(len(first.time), len(second.time))
    at = [theirs.index(name) for name in names]
    apart = np.linalg.norm(first.position[:frames] - second.position[:frames, at], axis=2)
    frame, body = (int(k) for k in np.unravel_index(apart.argmax(), apart.shape))
    over = np.flatnonzero((apart > limit).any(axis=1))
    remark = f"first beyond the limit in frame {over[0]}" if len(over) else ""
    place = Place(frame, (names[body],), remark)
    reason = "contacts are found to within it" if limit == ORDER_TOLERANCE else "as given"
    time = float(first.time[frame])
    return settled((Finding("order", float(apart.max()), "m", limit, reason, source, place, time),))


def _require_ended(first: Recording, second: Recording, what: str, source: str) -> None:
    ended = first.ended or second.ended
    if ended:
        raise InvariantError(f"{source}: {what} could not be judged: the run ended before its scene: {ended}")


def reordered(scenario: Scenario) -> Scenario:
    """The scenario with its bodies in reverse order; raises ValueError for driven bodies, whose links have an
    order of their own."""
    if scenario.trackers:
        raise ValueError(f"{scenario.name!r} has a driven body: its links cannot be reordered")
    return replace(scenario, bodies=scenario.bodies[::-1])
