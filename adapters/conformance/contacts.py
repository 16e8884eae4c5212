"""Checks of contacts: bodies, normal, distance, place, impulse, and the laws that they follow."""

from collections import Counter
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.conformance import scenes
from touchstone.adapters.conformance.bench import Bench, Snapshot
from touchstone.adapters.contract import Array
from touchstone.scenarios.scenario import Scenario

ALIGNED = 0.99
"""Cosine of the largest angle of a normal to the true one [1]."""
BALANCE = 0.02
"""Relative error of impulses against the change of momentum [1]."""
REACH = 0.5
"""Share of DEPTH by which a distance may be off [1]: margins and rounding."""
FRICTION, RESTITUTION = 0.2, 0.3
"""Error of an achieved coefficient, relative and absolute, that is a bug of an adapter rather than an
engine's own approximation [1]."""
BOUNCES = (0.2, 0.8)
"""Restitution asked [1]: an engine that ignores it returns the same share in both."""
SLIDING = 0.1
"""Time over which balls slide without rolling [s]: wood on wood rolls after 0.117 s."""


def normals(bench: Bench) -> Iterator[str]:
    """Contacts of two balls, and of a ball with a floor before and after it in the scene."""
    balls = (scenes.landing_ball(), scenes.landing_ball(first=True), scenes.meeting_balls())
    yield from bench.each((*balls, scenes.landing_box()), lambda scenario: _contacts(bench, scenario))


def _contacts(bench: Bench, scenario: Scenario) -> Iterator[str]:
    before, after = bench.play(scenario, 1)
    rows, names = after.contacts, [body.name for body in scenario.bodies]
    pair = "-".join(names)
    if not len(rows):
        yield f"no contact of pair {pair} is reported, though they overlap by {scenes.DEPTH * 1e3:g} mm"
        return
    if ((rows["body_a"] != 0) | (rows["body_b"] != 1)).any():
        a, b = int(rows[0]["body_a"]), int(rows[0]["body_b"])
        if (a, b) == (1, 0):
            yield f"contacts of pair {pair} name B first: A comes before B in the scene (State.add_contact)"
        else:
            yield f"contacts of pair {pair} name bodies {a} and {b}, expected 0 and 1"
        return
    yield from _twice(rows, pair)
    true = before.position[1] - before.position[0]
    if scenario.name != "meeting_balls":  # with a floor
        true = np.array([0.0, 0.0, true[2]])
    true = true / np.linalg.norm(true)
    along = rows["normal"] @ true
    if np.abs(np.linalg.norm(rows["normal"], axis=1) - 1).max() > 1e-3:
        yield f"a normal of pair {pair} has the length {np.linalg.norm(rows['normal'], axis=1).max():.4g}"
    elif (along < -ALIGNED).all():
        yield f"normals of pair {pair} point from B to A"
    elif (along < ALIGNED).any():
        found = rows["normal"][int(along.argmin())].round(4)
        yield f"a normal of pair {pair} is {found.tolist()}, expected {true.tolist()}"
    yield from _distance(rows, pair, after, before, true)
    yield from _impulse(bench, scenario, before, after, true)


def _twice(rows: NDArray[np.void], pair: str) -> Iterator[str]:
    seen = Counter(tuple(np.round(row["position"], 9)) for row in rows)
    for k, row in enumerate(rows):
        count = seen.pop(tuple(np.round(row["position"], 9)), 0)
        if count > 1:
            times = "twice" if count == 2 else f"{count} times"
            yield f"contact {k} of pair {pair} is reported {times}"


def _distance(
    rows: NDArray[np.void], pair: str, after: Snapshot, before: Snapshot, true: Array
) -> Iterator[str]:
    found, asked = float(np.median(rows["distance"])), -scenes.DEPTH
    if abs(found - asked) <= REACH * scenes.DEPTH:
        return
    moved = float((after.position[1] - after.position[0] - before.position[1] + before.position[0]) @ true)
    if abs(found + asked) <= REACH * scenes.DEPTH:
        yield f"distance of pair {pair} is positive in overlap; the contract wants it negative"
    elif abs(moved) > scenes.DEPTH and abs(found - asked - moved) <= REACH * scenes.DEPTH:
        yield f"contacts of pair {pair} are those of the step's end; the contract wants those of its start"
    else:
        fault = f"pair {pair} overlaps by {-found * 1e3:.4g} mm, placed to overlap by {-asked * 1e3:g} mm"
        yield f"{fault}: check half and full extents"


def _impulse(
    bench: Bench, scenario: Scenario, before: Snapshot, after: Snapshot, true: Array
) -> Iterator[str]:
    pair = "-".join(body.name for body in scenario.bodies)
    k = 1 if scenario.bodies[1].kind == "simulated" else 0
    change = scenario.bodies[k].mass * (after.linear_velocity[k] - before.linear_velocity[k])
    change = change if k == 1 else -change
    reported = after.contacts["impulse"].sum(axis=0)
    size = float(np.linalg.norm(change))
    if size < 1e-9:
        yield f"pair {pair} meets at {scenes.SPEED:g} m/s and overlaps, but nothing stops it"
        return
    if np.linalg.norm(reported - change) <= BALANCE * size:
        return
    ratio = float(reported @ change) / size**2
    if abs(ratio * bench.dt - 1) <= BALANCE:
        yield f"impulses of pair {pair} are forces: multiply by the step"
    elif abs(ratio / bench.dt - 1) <= BALANCE or abs(ratio) < 1e-9:
        yield f"impulses of pair {pair} explain {ratio:.3g} of the change of momentum"
    elif abs(ratio + 1) <= BALANCE:
        yield f"impulses of pair {pair} act on A; the contract wants those on B"
    else:
        yield f"impulses of pair {pair} explain {ratio:.3g} of the change of momentum, expected 1"


def stale(bench: Bench) -> Iterator[str]:
    """Contacts are those of the last step alone."""
    scenario = scenes.bouncing_ball()
    seen = bench.play(scenario, round(0.6 / bench.dt))
    heights = np.array([one.position[1, 2] for one in seen])
    flying = [k for k in range(2, len(seen)) if min(heights[k - 2 : k + 1]) > scenes.RADIUS + 0.05]
    if flying and any(len(seen[k].contacts) and np.any(seen[k].contacts["impulse"]) for k in flying):
        yield "contacts of earlier steps are still reported while the ball flies"


def coefficients(bench: Bench) -> Iterator[str]:
    """Friction and restitution act as asked, to within what an engine may approximate."""
    steps = round(SLIDING / bench.dt)
    seen = bench.play(scenes.sliding_balls(), steps)
    first = steps // 4
    for k, name, asked in ((1, "wooden-floor", 0.5), (2, "steel-floor", 0.2)):
        lost = float(seen[first].linear_velocity[k, 0] - seen[-1].linear_velocity[k, 0])
        found = lost / ((steps - first) * bench.dt) / 9.81
        if abs(found - asked) > FRICTION * asked:
            yield f"friction of pair {name} acts as {found:.3g}, asked {asked:g}"


def bounce(bench: Bench) -> Iterator[str]:
    """A ball returns the asked share of its speed, of two shares."""
    pair, found = "restitution of pair floor-ball acts as", []
    for asked in BOUNCES:
        seen = bench.play(scenes.bouncing_ball(asked), round(0.6 / bench.dt))
        speeds = np.array([one.linear_velocity[1, 2] for one in seen])
        found.append(max(0.0, float(speeds.max() / -speeds.min())) if speeds.min() < 0 else 0.0)
    (low, high), (less, more) = BOUNCES, found
    if more - less < (high - low) / 2:
        both = f"{less:.3g} and {more:.3g}, asked {low:g} and {high:g}"
        yield f"{pair} {both}: it does not follow what is asked"
        return
    for asked, one in zip(BOUNCES, found):
        if abs(one - asked) > RESTITUTION:
            yield f"{pair} {one:.3g}, asked {asked:g}"
