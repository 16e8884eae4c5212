"""Collision masks and priorities of MuJoCo's geoms, which give each pair its contact parameters.

MuJoCo collides two geoms if the contype of one shares a bit with the conaffinity of the other. It takes all
contact parameters (condim, friction, solref) from the geom of higher priority (MuJoCo documentation,
"Computation: Collision detection" and "Contact parameters"). An explicit `<pair>` has its own parameters, but
skips the broad phase: every one is tested in every step. Pairs are therefore a last resort.

Bodies are grouped by kind or tracker, and by material; every pair of groups that can meet has one
(restitution, friction). A greedy pass assigns falling priorities. The next group is one whose pairs with all
remaining groups share their coefficients, and it imposes these. If there is none, the group with the fewest
deviating geom pairs is next, and those pairs become explicit.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from touchstone.scenarios.scenario import Scenario

Coefficients = tuple[float, float]
"""Restitution and friction [1]."""
Group = tuple[str, int, str]
"""Kind, tracker (-1: none) and material of bodies with the same contact parameters."""
Pair = tuple[int, int]

MASK_BITS = 31
"""Number of usable bits of a contype [1], a signed 32-bit number."""


@dataclass(frozen=True, slots=True)
class GeomFilter:
    """Settings of all geoms of a body: mask bits, priority, and the (restitution, friction) it imposes."""

    contype: int
    conaffinity: int
    priority: int
    coefficients: Coefficients


@dataclass(frozen=True, slots=True)
class ContactFilter:
    """Representation of a scenario's touching pairs in MuJoCo.

    Attributes:
        geoms: per body with a shape that can meet something; geoms of other bodies have masks of zero.
        excluded: pairs of bodies (a < b) that the masks would let collide but that may not touch.
        explicit: pairs of bodies that need a `<pair>` for every two of their geoms.
    """

    geoms: Mapping[int, GeomFilter]
    excluded: tuple[Pair, ...]
    explicit: tuple[Pair, ...]


def contact_filter(scenario: Scenario) -> ContactFilter:
    """Masks, priorities and exceptions that give every touching pair its coefficients and exclude all other
    pairs."""
    touching = tuple(scenario.touching_pairs())
    group_of: list[Group] = [
        (body.kind, tracker, body.material) for body, tracker in zip(scenario.bodies, scenario.groups())
    ]
    kinds = list(dict.fromkeys((kind, tracker) for kind, tracker, _ in group_of))
    if len(kinds) > MASK_BITS:
        return ContactFilter({}, (), touching)
    between: dict[frozenset[Group], Coefficients] = {}
    weight: Counter[frozenset[Group]] = Counter()
    for a, b in touching:
        both = frozenset((group_of[a], group_of[b]))
        between[both] = scenario.pair_coefficients(a, b)
        weight[both] += len(scenario.bodies[a].pieces) * len(scenario.bodies[b].pieces)
    imposed, deviating = _peeled(between, weight)
    bit = {kind: 1 << k for k, kind in enumerate(kinds)}
    affinity = dict.fromkeys(kinds, 0)
    for both in between:
        first, other = min(both), max(both)
        affinity[first[:2]] |= bit[other[:2]]
        affinity[other[:2]] |= bit[first[:2]]
    rank = {group: k for k, group in enumerate(reversed(imposed))}
    geoms = {
        k: GeomFilter(bit[group[:2]], affinity[group[:2]], rank[group], imposed[group])
        for k in sorted({body for pair in touching for body in pair})
        for group in (group_of[k],)
    }
    explicit = tuple(
        pair for pair in touching if frozenset((group_of[pair[0]], group_of[pair[1]])) in deviating
    )
    return ContactFilter(geoms, _excluded(scenario, geoms, touching), explicit)


def _peeled(
    between: Mapping[frozenset[Group], Coefficients], weight: Mapping[frozenset[Group], int]
) -> tuple[dict[Group, Coefficients], set[frozenset[Group]]]:
    """Groups in order of falling priority with the coefficients they impose, and the pairs of groups that
    would get wrong coefficients from them."""
    left = list(dict.fromkeys(group for both in between for group in sorted(both)))
    imposed: dict[Group, Coefficients] = {}
    deviating: set[frozenset[Group]] = set()
    while left:
        choices = []
        for k, group in enumerate(left):
            pairs = [both for both in between if group in both and both <= set(left)]
            counts: Counter[Coefficients] = Counter()
            for both in pairs:
                counts[between[both]] += weight[both]
            most = max(counts, key=lambda one: (counts[one], one), default=(0.0, 0.0))
            wrong = [both for both in pairs if between[both] != most]
            choices.append((sum(weight[both] for both in wrong), k, most, wrong))
        _, k, most, wrong = min(choices)
        imposed[left.pop(k)] = most
        deviating.update(wrong)
    return imposed, deviating


def _excluded(
    scenario: Scenario, geoms: Mapping[int, GeomFilter], touching: tuple[Pair, ...]
) -> tuple[Pair, ...]:
    """Pairs of bodies that the masks let collide although they may not touch."""
    allowed, masked = set(touching), sorted(geoms)
    return tuple(
        (a, b)
        for i, a in enumerate(masked)
        for b in masked[i + 1 :]
        if (geoms[a].contype & geoms[b].conaffinity or geoms[b].contype & geoms[a].conaffinity)
        and (a, b) not in allowed
    )
