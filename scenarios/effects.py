"""The effects of a simulation: what needs each, and which stage of the reference it switches."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.plural import plural
from touchstone.scenarios.scenario import Body, Scenario, Sphere

Pair = tuple[int, int]
Need = tuple[bool, str]
"""Whether an effect is needed, and the reason in words for a table."""


@dataclass(frozen=True, slots=True)
class Meetings:
    """What a scene's bounds tell of its contacts.

    Attributes:
        gap: lower bounds on distances between bodies (n, n) [m].
        may_touch: pairs of bodies that the scene lets touch; `meeting`: those of them that can.
    """

    scenario: Scenario
    gap: Array
    may_touch: list[Pair]
    meeting: list[Pair]

    @property
    def simulated(self) -> list[Body]:
        """Simulated bodies."""
        return [body for body in self.scenario.bodies if body.kind == "simulated"]

    @property
    def own(self) -> list[Pair]:
        """Links of one driven body that may touch."""
        group = self.scenario.groups()
        return [(a, b) for a, b in self.may_touch if group[a] == group[b] >= 0]

    @property
    def driven(self) -> list[Pair]:
        """Pairs with a driven or prescribed body that can meet."""
        group = self.scenario.groups()
        return [(a, b) for a, b in self.meeting if max(group[a], group[b]) >= 0]

    def named(self, pairs: list[Pair]) -> str:
        """The first pair by name, and the number of others."""
        one, two = (self.scenario.bodies[k].name for k in pairs[0])
        return f"{one} and {two}" + (f" and {plural(len(pairs) - 1, 'pair')} more" if len(pairs) > 1 else "")

    def apart(self, pairs: list[Pair]) -> str:
        """The pair that comes nearest, and how near."""
        gap = self.gap
        nearest = min(pairs, key=lambda pair: max(gap[pair], gap[pair[::-1]]))
        distance = max(gap[nearest], gap[nearest[::-1]])
        return f"{self.named([nearest])} come nearest and stay {distance:.2g} m apart"


def _gravity(known: Meetings) -> Need:
    if not known.simulated:
        return False, "no body is simulated"
    pulls = any(known.scenario.acting_gravity)
    return pulls, f"pulls at {named_body(known.simulated)}" if pulls else "is zero"


def _restitution(known: Meetings) -> Need:
    return _coefficient(known, 0, "e")


def _friction(known: Meetings) -> Need:
    needed, reason = _coefficient(known, 1, "mu")
    for moment in (_rolling_friction, _torsional_friction):
        if not needed:
            needed, other = moment(known)
            reason = other if needed else reason
    return needed, reason


def _static_friction(known: Meetings) -> Need:
    return _beyond_mu(known, "static", "", "every pair that can meet sticks by its mu alone")


def _rolling_friction(known: Meetings) -> Need:
    return _beyond_mu(known, "rolling", " m", "no pair that can meet has a length of rolling friction")


def _torsional_friction(known: Meetings) -> Need:
    return _beyond_mu(known, "torsional", " m", "no pair that can meet has a length of torsional friction")


def _beyond_mu(known: Meetings, law: str, unit: str, without: str) -> Need:
    for pair in known.meeting:
        value = getattr(known.scenario.friction_law(*pair), law)
        if value > 0:
            return True, f"{law} friction of {value:g}{unit} between {known.named([pair])}"
    return False, without if known.meeting else "no pair can meet"


def _coefficient(known: Meetings, which: int, symbol: str) -> Need:
    for pair in known.meeting:
        value = known.scenario.pair_coefficients(*pair)[which]
        if value > 0:
            return True, f"{symbol} = {value:g} between {known.named([pair])}"
    return False, f"every pair that can meet has {symbol} = 0" if known.meeting else "no pair can meet"


def _contact(known: Meetings) -> Need:
    met = set(known.meeting)
    others = [pair for pair in known.may_touch if pair not in met]
    if not known.may_touch:
        return False, "no two bodies may touch"
    if not met:
        return False, known.apart(others)
    reason = f"{len(met)} of {plural(len(known.may_touch), 'pair')} can meet: {known.named(known.meeting)}"
    return True, f"{reason}; of the others {known.apart(others)}" if others else reason


def _self_collision(known: Meetings) -> Need:
    own, met = known.own, set(known.meeting)
    if meeting := [pair for pair in own if pair in met]:
        return True, f"{known.named(meeting)} can meet"
    return False, known.apart(own) if own else "no two links of one driven body may touch"


def _overlap_removal(known: Meetings) -> Need:
    if driven := known.driven:
        return True, f"{known.named(driven)} can meet"
    return False, "no driven body can meet anything"


def _inverse_kinematics(known: Meetings) -> Need:
    chains = len(known.scenario.chains)
    if not chains:
        return False, "no chain of hinges"
    meets, reason = _overlap_removal(known)
    return meets, f"{chains} chains, and {reason}" if meets else reason


def _reach_cones(known: Meetings) -> Need:
    """Attraction also turns joints towards the cones' limits if the tracker is outside them."""
    cones = sum(len(chain.cones) for chain in known.scenario.chains)
    return bool(cones), f"{cones} ball joints" if cones else "no ball joint"


def _attraction(known: Meetings) -> Need:
    chains = bool(known.scenario.chains)
    return chains, "postures return to the tracker's" if chains else "no chain of hinges"


def _virtual_coupling(known: Meetings) -> Need:
    trackers = len(known.scenario.trackers)
    return bool(
        trackers
    ), f"{plural(trackers, 'tracker')} to follow" if trackers else "no body follows a tracker"


def _sweep(known: Meetings) -> Need:
    return bool(known.meeting), "where the profile sweeps" if known.meeting else "no pair can meet"


def _sleeping(known: Meetings) -> Need:
    return False, "a body at rest is simulated like any other, with all effects too"


def _rotation(known: Meetings) -> Need:
    """Whether a simulated body turns or could be turned, and by what."""
    scenario = known.scenario
    simulated = {k for k, body in enumerate(scenario.bodies) if body.kind == "simulated"}
    if not simulated:
        return False, "no body is simulated"
    for k in simulated:
        if any(scenario.bodies[k].angular_velocity):
            return True, f"{scenario.bodies[k].name} spins from the start"
    if scenario.body_joints:
        return True, f"{plural(len(scenario.body_joints), 'joint')} can turn bodies"
    for pair in known.meeting:
        for k in simulated & set(pair):
            body, other = scenario.bodies[k], scenario.bodies[sum(pair) - k]
            law = scenario.friction_law(*pair)
            frictionless = scenario.pair_coefficients(*pair)[1] + law.rolling + law.torsional == 0
            by_rounding = frictionless and centred_ball(body)
            how = " by rounding" if by_rounding else ""
            return True, f"contact with {other.name} can turn {body.name}{how}"
    return False, "no body spins, and nothing can turn one"


def named_body(bodies: list[Body]) -> str:
    """Name of the first body, and the number of others."""
    return bodies[0].name + (f" and {plural(len(bodies) - 1, 'body')} more" if len(bodies) > 1 else "")


def centred_ball(body: Body) -> bool:
    """Whether a body is a ball about its centre of mass, so that every normal force passes through it."""
    return all(isinstance(p.shape, Sphere) and p.position == body.center_of_mass for p in body.pieces)


@dataclass(frozen=True, slots=True)
class Effect:
    """A part of the simulation that a plan may leave out.

    Attributes:
        name: of the effect; `short`: head of its column.
        need: whether a scene needs it, and why.
        stage: stage of the reference that does not run without it; empty: none.
        only: `reference` or `engines` if the others have no such stage (in other engines contacts push and
            hinges follow a servo); empty: all have it.
        approximate: it discards motion, so that `all` leaves it out; name it to enable it.
    """

    name: str
    short: str
    need: Callable[[Meetings], Need]
    stage: str = ""
    only: Literal["", "reference", "engines"] = ""
    approximate: bool = False


EFFECT_TABLE: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        Effect("gravity", "grav", _gravity),
        Effect("rotation", "rot", _rotation, stage="rotation"),
        Effect("restitution", "rest", _restitution),
        Effect("friction", "fric", _friction),
        Effect("static_friction", "stat", _static_friction),
        Effect("rolling_friction", "roll", _rolling_friction),
        Effect("torsional_friction", "tors", _torsional_friction),
        Effect("contact", "cont", _contact, stage="contact"),
        Effect("self_collision", "self", _self_collision),
        Effect("overlap_removal", "rem", _overlap_removal, stage="removal", only="reference"),
        Effect("inverse_kinematics", "ik", _inverse_kinematics, only="reference"),
        Effect("reach_cones", "cone", _reach_cones, only="reference"),
        Effect("attraction", "attr", _attraction, only="reference"),
        Effect("virtual_coupling", "coup", _virtual_coupling, stage="drive"),
        Effect("sweep", "swp", _sweep, stage="sweep", only="reference"),
        Effect("sleeping", "slp", _sleeping, only="engines", approximate=True),
    )
}
"""All that the project knows of effects; one row each."""
PLANNED = tuple(EFFECT_TABLE)
"""Names of the effects that a plan decides on."""
