"""Plan of the effects that a scene requires, with reasons, from bounds on its motion and without simulation.

The plan omits an effect only if it cannot change the outcome while the bounds hold; a run checks them
(`Plan.broken`). `adapters/motion_bounds.py` computes the bounds.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from touchstone.scenarios.scenario import Body, Scenario, Sphere, Tracker

Array = NDArray[np.float64]
Pair = tuple[int, int]
State = Literal["needed", "not needed", "forced on", "forced off"]
Need = tuple[bool, str]
"""Whether an effect is needed, and the reason in words for a table."""

PLANNED = (
    "gravity",
    "rotation",
    "restitution",
    "friction",
    "contact",
    "self_collision",
    "overlap_removal",
    "inverse_kinematics",
    "reach_cones",
    "attraction",
    "virtual_coupling",
    "sweep",
    "sleeping",
)
"""Effects that a plan decides on."""


SKIPPED = ("drive", "removal", "contact", "rotation", "sweep")
"""Stages of the reference that a plan may skip: the drive, overlap removal, contacts of simulated bodies,
their rotation, and time of impact; without the last, it tests the ends of steps only."""
STAGES_OF_OURS = ("overlap_removal", "inverse_kinematics", "reach_cones", "attraction", "sweep")
"""Effects for which only the reference has a stage: in other engines contacts push and hinges follow a
servo."""
APPROXIMATE = ("sleeping",)
"""Effects excluded when all are requested, because they discard motion; name them to enable them."""
STIFF = 1e9
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
        """Whether the effect's stage runs."""
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
        skipped: those of SKIPPED that the reference does not run.
    """

    decisions: tuple[Decision, ...]
    pairs: tuple[Pair, ...]
    pieces: tuple[tuple[int, ...], ...]
    bounds: Bounds
    apart: NDArray[np.intp]
    skipped: tuple[str, ...]

    def on(self, effect: str) -> bool:
        """Whether an effect's stage runs."""
        return self.decisions[PLANNED.index(effect)].on

    @property
    def stages(self) -> tuple[str, ...]:
        """Effects whose stages run."""
        return tuple(decision.effect for decision in self.decisions if decision.on)

    @property
    def removed(self) -> tuple[str, ...]:
        """Effects that the scene requires but that the caller excluded."""
        return tuple(decision.effect for decision in self.decisions if decision.state == "forced off")

    def applied(self, scenario: Scenario) -> Scenario:
        """Scenario without what the plan omits: pieces, coefficients, gravity, chains and cones."""
        driven = {k for links in map(scenario.links, scenario.trackers) for k in links if self.pieces[k]}
        groups = scenario.groups()
        followed = {groups[k] for k in driven}
        bodies = tuple(
            body
            # A hand or an avatar keeps all pieces, because these determine which of its links are adjacent.
            if len(kept) == len(body.pieces) or groups[k] in followed
            else replace(body, pieces=tuple(body.pieces[i] for i in kept))
            for k, (body, kept) in enumerate(zip(scenario.bodies, self.pieces))
        )
        if "rotation" in self.removed:
            bodies = tuple(_held_from_turning(body) for body in bodies)
        effects = tuple(effect for effect in scenario.effects if self.on(effect))
        chains = scenario.chains if self.on("inverse_kinematics") or self.on("attraction") else ()
        if "inverse_kinematics" in self.removed:
            chains = ()
        if not self.on("reach_cones"):
            chains = tuple(replace(chain, cones=()) for chain in chains)
        trackers = tuple(map(self._shown, scenario.trackers))
        return scenario.reduced(bodies=bodies, effects=effects, chains=chains, trackers=trackers)

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
            PLANNED, without those of APPROXIMATE. None: the effects that the scene requires, with contact
            between pairs that can meet.
    """
    asked_for_all = effects is not None and set(PLANNED) <= set(effects)
    may_touch = list(scenario.touching_pairs())
    gap = least_gap(bounds.gap, bounds.body)
    meeting = [(a, b) for a, b in may_touch if max(gap[a, b], gap[b, a]) <= 0]
    needs = _needs(scenario, gap, may_touch, meeting)
    if asked_for_all:
        effects = tuple(effect for effect in PLANNED if effect not in APPROXIMATE)
    decisions = tuple(_decide(effect, *needs[effect], effects) for effect in PLANNED)
    on = {decision.effect for decision in decisions if decision.on}
    group = scenario.groups()
    own = {(a, b) for a, b in may_touch if group[a] == group[b] >= 0}
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
    """Stages of the reference that have nothing to do, in the order of SKIPPED."""
    simulated = {k for k, body in enumerate(scenario.bodies) if body.kind == "simulated"}
    contact = "contact" in on and (everything or any(simulated & set(pair) for pair in pairs))
    runs = {
        "drive": "virtual_coupling" in on,
        "removal": "overlap_removal" in on,
        "contact": contact,
        "rotation": "rotation" in on or contact,
        "sweep": "sweep" in on,
    }
    return tuple(stage for stage in SKIPPED if not runs[stage])


def _held_from_turning(body: Body) -> Body:
    """A simulated body without rotation and with an inertia that prevents it."""
    if body.kind != "simulated":
        return body
    one, two, three = ((STIFF * x, STIFF * y, STIFF * z) for x, y, z in body.inertia)
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


def _needs(scenario: Scenario, gap: Array, may_touch: list[Pair], meeting: list[Pair]) -> dict[str, Need]:
    """Whether each effect is needed, and why."""
    group = scenario.groups()
    own = [(a, b) for a, b in may_touch if group[a] == group[b] >= 0]
    met = set(meeting)
    own_meeting = [pair for pair in own if pair in met]
    driven = [(a, b) for a, b in meeting if max(group[a], group[b]) >= 0]
    simulated = [body for body in scenario.bodies if body.kind == "simulated"]
    chains, cones = len(scenario.chains), sum(len(chain.cones) for chain in scenario.chains)

    def named(pairs: list[Pair]) -> str:
        one, two = (scenario.bodies[k].name for k in pairs[0])
        return f"{one} and {two}" + (f" and {len(pairs) - 1} pairs more" if len(pairs) > 1 else "")

    def apart(pairs: list[Pair]) -> str:
        nearest = min(pairs, key=lambda pair: max(gap[pair], gap[pair[::-1]]))
        return f"{named([nearest])} come nearest and stay {max(gap[nearest], gap[nearest[::-1]]):.2g} m apart"

    def coefficient(which: int, symbol: str) -> Need:
        for pair in meeting:
            value = scenario.pair_coefficients(*pair)[which]
            if value > 0:
                return True, f"{symbol} = {value:g} between {named([pair])}"
        return False, f"every pair that can meet has {symbol} = 0" if meeting else "no pair can meet"

    def contact() -> Need:
        others = [pair for pair in may_touch if pair not in met]
        if not may_touch:
            return False, "no two bodies may touch"
        if not meeting:
            return False, apart(others)
        reason = f"{len(meeting)} of {len(may_touch)} pairs can meet: {named(meeting)}"
        return True, f"{reason}; of the others {apart(others)}" if others else reason

    def gravity() -> Need:
        if not simulated:
            return False, "no body is simulated"
        pulls = any(scenario.acting_gravity)
        return pulls, f"pulls at {named_body(simulated)}" if pulls else "is zero"

    def self_collision() -> Need:
        if own_meeting:
            return True, f"{named(own_meeting)} can meet"
        return False, apart(own) if own else "no two links of one driven body may touch"

    moved = (True, f"{named(driven)} can meet") if driven else (False, "no driven body can meet anything")
    if not chains:
        kinematics: Need = (False, "no chain of hinges")
    else:
        kinematics = (bool(driven), f"{chains} chains, and {moved[1]}" if driven else moved[1])
    return {
        "gravity": gravity(),
        "rotation": _rotation(scenario, meeting),
        "restitution": coefficient(0, "e"),
        "friction": coefficient(1, "mu"),
        "contact": contact(),
        "self_collision": self_collision(),
        "overlap_removal": moved,
        "inverse_kinematics": kinematics,
        # Attraction also turns joints towards the cones' limits if the tracker is outside them.
        "reach_cones": (bool(cones), f"{cones} ball joints" if cones else "no ball joint"),
        "attraction": (
            bool(chains),
            "postures return to the tracker's" if chains else "no chain of hinges",
        ),
        "virtual_coupling": (
            bool(scenario.trackers),
            f"{len(scenario.trackers)} driven bodies" if scenario.trackers else "no driven body",
        ),
        "sweep": (bool(meeting), "where the profile sweeps" if meeting else "no pair can meet"),
        "sleeping": (False, "a body at rest is simulated like any other, with all effects too"),
    }


def named_body(bodies: list[Body]) -> str:
    """Name of the first body, and the number of others."""
    return bodies[0].name + (f" and {len(bodies) - 1} bodies more" if len(bodies) > 1 else "")


def _rotation(scenario: Scenario, meeting: list[Pair]) -> Need:
    """Whether a simulated body turns or could be turned, and by what."""
    simulated = {k for k, body in enumerate(scenario.bodies) if body.kind == "simulated"}
    if not simulated:
        return False, "no body is simulated"
    for k in simulated:
        if any(scenario.bodies[k].angular_velocity):
            return True, f"{scenario.bodies[k].name} spins from the start"
    for pair in meeting:
        for k in simulated & set(pair):
            body, other = scenario.bodies[k], scenario.bodies[sum(pair) - k]
            by_rounding = scenario.pair_coefficients(*pair)[1] == 0 and centred_ball(body)
            how = " by rounding" if by_rounding else ""
            return True, f"contact with {other.name} can turn {body.name}{how}"
    return False, "no body spins, and nothing can turn one"


def centred_ball(body: Body) -> bool:
    """Whether a body is a ball about its centre of mass, so that every normal force passes through it."""
    return all(isinstance(p.shape, Sphere) and p.position == body.center_of_mass for p in body.pieces)
