"""Plan of the effects that a scene requires, with reasons, from bounds on its motion and without simulation.

The plan omits an effect only if it cannot change the outcome while the bounds hold; a run checks them
(`Plan.broken`). `adapters/motion_bounds.py` computes the bounds.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.effects import EFFECT_TABLE, PLANNED, Meetings, Pair
from touchstone.scenarios.scenario import FRICTION_LAWS, Body, Scenario, Tracker

State = Literal["needed", "not needed", "forced on", "forced off"]
INERTIA_FACTOR = 1e9
"""Factor on the inertia of bodies that must not turn [1]: impacts turn them by no more than rounding shows in
a picture, and no engine divides by zero."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """Bounds on the motion of n bodies and their p pieces, in order.

    Attributes:
        body: index of each piece's body (p,).
        reach: radius of a body's pieces about its origin (n,) [m].
        low, high: box that contains a body's origin (n, 3) [m, world]; infinite if unbounded.
        gap: lower bounds on distances between bodies and pieces (n, p) [m]; 0 if they may meet. Between links
            of one driven body: by the bounding balls of radius `reach` about their origins.
    """

    body: NDArray[np.intp]
    reach: Array
    low: Array
    high: Array
    gap: Array


def box_gap(low: Array, high: Array, other_low: Array, other_high: Array) -> Array:
    """Distances between n boxes and p others (n, p) [m]; 0 if they overlap."""
    with np.errstate(invalid="ignore"):
        apart = np.maximum(low[:, None] - other_high, other_low - high[:, None])
    return np.linalg.norm(np.maximum(np.nan_to_num(apart, nan=0.0, posinf=np.inf), 0.0), axis=-1)


def least_gap(gap: Array, body: NDArray[np.intp]) -> Array:
    """Lower bounds on the distances of n bodies (n, n) [m], from their gaps to pieces; infinite for bodies
    without pieces."""
    least = np.full((len(gap), len(gap)), np.inf)
    for k in np.unique(body):
        least[:, k] = gap[:, body == k].min(axis=1)
    return least


@dataclass(frozen=True, slots=True)
class Decision:
    """Decision on an effect, and its reason."""

    effect: str
    state: State
    reason: str

    @property
    def on(self) -> bool:
        return self.state in ("needed", "forced on")


@dataclass(frozen=True, slots=True)
class Plan:
    """Effects of a run.

    Attributes:
        decisions: one per effect, in the order of PLANNED.
        pairs: bodies (a < b) that are tested for contact.
        pieces: per body the indices of the pieces that can meet something.
        bounds: bounds on the bodies' motion for which the plan is valid.
        apart: links of one driven body (k, 2) that must stay apart.
        skipped: stages that the reference does not run; without `sweep` it tests the ends of steps only.
    """

    decisions: tuple[Decision, ...]
    pairs: tuple[Pair, ...]
    pieces: tuple[tuple[int, ...], ...]
    bounds: Bounds
    apart: NDArray[np.intp]
    skipped: tuple[str, ...]

    def on(self, effect: str) -> bool:
        return self.decisions[PLANNED.index(effect)].on

    @property
    def stages(self) -> tuple[str, ...]:
        """Effects whose stages run."""
        return tuple(decision.effect for decision in self.decisions if decision.on)

    @property
    def removed(self) -> tuple[str, ...]:
        """Effects that the scene requires but that the caller excluded."""
        return tuple(decision.effect for decision in self.decisions if decision.state == "forced off")

    def applied(self, scenario: Scenario, keeps: Collection[str] = ()) -> Scenario:
        """Scenario without what the plan omits: pieces, coefficients, gravity, chains and cones; `keeps`
        names what stays all the same (`Entry.keeps`), unless the caller excluded it."""
        contact = self.on("contact")
        driven = {k for links in map(scenario.links, scenario.trackers) for k in links if self.pieces[k]}
        groups = scenario.groups()
        followed = {groups[k] for k in driven}
        bodies = tuple(
            body
            # A hand or an avatar keeps all pieces, because these determine which of its links are adjacent.
            if len(kept) == len(body.pieces)
            or groups[k] in followed
            or ("fixed" in keeps and contact and body.kind == "fixed")
            or ("met" in keeps and kept)
            or ("moving" in keeps and body.kind != "fixed" and "contact" not in self.removed)
            else replace(body, pieces=tuple(body.pieces[i] for i in kept))
            for k, (body, kept) in enumerate(zip(scenario.bodies, self.pieces))
        )
        if "rotation" in self.removed:
            bodies = tuple(_held_from_turning(body) for body in bodies)
        stays = {"gravity"} & set(keeps) - set(self.removed)
        effects = tuple(effect for effect in scenario.effects if effect in stays or self.on(effect))
        chains = scenario.chains if self.on("inverse_kinematics") or self.on("attraction") else ()
        if "inverse_kinematics" in self.removed:
            chains = ()
        if not self.on("reach_cones"):
            chains = tuple(replace(chain, cones=()) for chain in chains)
        trackers = tuple(map(self._shown, scenario.trackers))
        left_out: dict[str, Any] = dict.fromkeys((name for name in FRICTION_LAWS if not self.on(name)), 0.0)
        coefficients = tuple(replace(pair, **left_out) for pair in scenario.coefficients)
        return scenario.reduced(
            bodies=bodies, effects=effects, chains=chains, trackers=trackers, coefficients=coefficients
        )

    def _shown(self, tracker: Tracker) -> Tracker:
        """Tracker without motion that nothing follows: constant joints without attraction, and a constant
        root as well without coupling."""
        count = len(tracker.times)
        if {"attraction", "virtual_coupling"} & set(self.removed):
            tracker = replace(tracker, angles=tracker.angles[:1] * count)
        if "virtual_coupling" in self.removed:
            start = tracker.positions[:1] * count, tracker.orientations[:1] * count
            tracker = replace(tracker, positions=start[0], orientations=start[1])
        return tracker

    def broken(self, position: Array, names: Sequence[str]) -> str | None:
        """Message on the bound that the bodies' origins (n, 3) [m] violate; None if all hold."""
        bounds = self.bounds
        out = ((position < bounds.low) | (position > bounds.high)).any(axis=1)
        if out.any():
            return f"{names[int(np.argmax(out))]} left the bounds of its plan"
        if len(self.apart):
            a, b = self.apart.T
            gap = np.linalg.norm(position[a] - position[b], axis=1) - bounds.reach[a] - bounds.reach[b]
            if gap.min() < 0:
                k = int(np.argmin(gap))
                return f"{names[a[k]]} and {names[b[k]]} came together"
        return None


def plan(scenario: Scenario, bounds: Bounds, effects: Collection[str] | None = None) -> Plan:
    """Decide on every effect.

    Args:
        effects: run exactly these effects, with contact between all pairs that may touch; if they name all of
            PLANNED, without approximate ones. None: the effects that the scene requires, with contact
            between pairs that can meet.
    """
    asked_for_all = effects is not None and set(PLANNED) <= set(effects)
    may_touch = list(scenario.touching_pairs())
    gap = least_gap(bounds.gap, bounds.body)
    meeting = [(a, b) for a, b in may_touch if max(gap[a, b], gap[b, a]) <= 0]
    known = Meetings(scenario, gap, may_touch, meeting)
    needs = {name: effect.need(known) for name, effect in EFFECT_TABLE.items()}
    if asked_for_all:
        effects = tuple(name for name, effect in EFFECT_TABLE.items() if not effect.approximate)
    decisions = tuple(_decide(effect, *needs[effect], effects) for effect in PLANNED)
    on = {decision.effect for decision in decisions if decision.on}
    own = set(known.own)
    # Without an effect that it needs, a scene may leave its bounds, so the plan must not use them.
    forced_off = any(decision.state == "forced off" for decision in decisions)
    everything = asked_for_all or forced_off
    pairs = may_touch if everything or not meeting else meeting
    pairs = [pair for pair in pairs if "contact" in on and ("self_collision" in on or pair not in own)]
    kept = _pieces(scenario, bounds, pairs, everything)
    apart = [] if needs["self_collision"][0] else sorted(own)
    if everything:
        endless = np.full_like(bounds.low, np.inf)
        bounds, apart = replace(bounds, low=-endless, high=endless), []
    return Plan(
        decisions,
        tuple(pairs),
        kept,
        bounds,
        np.array(apart, dtype=np.intp).reshape(-1, 2),
        _skipped(scenario, on, pairs, everything),
    )


def _skipped(scenario: Scenario, on: Collection[str], pairs: list[Pair], everything: bool) -> tuple[str, ...]:
    """Stages of the reference that have nothing to do.

    These are the stages of effects that are off, contact where no simulated body can meet anything, and
    rotation where neither it nor contact runs.
    """
    simulated = {k for k, body in enumerate(scenario.bodies) if body.kind == "simulated"}
    contact = "contact" in on and (everything or any(simulated & set(pair) for pair in pairs))
    runs = {effect.stage: effect.name in on for effect in EFFECT_TABLE.values() if effect.stage}
    runs |= {"contact": contact, "rotation": "rotation" in on or contact}
    return tuple(stage for stage, wanted in runs.items() if not wanted)


def _held_from_turning(body: Body) -> Body:
    """A simulated body without rotation and with an inertia that prevents it."""
    if body.kind != "simulated":
        return body
    one, two, three = (
        (INERTIA_FACTOR * x, INERTIA_FACTOR * y, INERTIA_FACTOR * z) for x, y, z in body.inertia
    )
    return replace(body, angular_velocity=(0.0, 0.0, 0.0), inertia=(one, two, three))


def _decide(effect: str, needed: bool, reason: str, effects: Collection[str] | None) -> Decision:
    state: State = "needed" if needed else "not needed"
    if effects is None or needed == (effect in effects):
        return Decision(effect, state, reason)
    return Decision(effect, "forced off" if needed else "forced on", f"asked for; {state}: {reason}")


def _pieces(
    scenario: Scenario, bounds: Bounds, pairs: Collection[Pair], everything: bool
) -> tuple[tuple[int, ...], ...]:
    """Per body the pieces that a body of its pairs can reach; all pieces if `everything`."""
    kept = [np.zeros(len(body.pieces), bool) for body in scenario.bodies]
    first = np.searchsorted(bounds.body, np.arange(len(scenario.bodies)))
    for pair in pairs:
        for a, b in (pair, pair[::-1]):
            near = bounds.gap[a, first[b] : first[b] + len(kept[b])] <= 0
            kept[b] |= near | everything | (scenario.bodies[b].kind != "fixed")
    return tuple(tuple(np.flatnonzero(one).tolist()) for one in kept)
