"""Impacts of balls without gravity: the tests of Chung & Ooi (2011), and the ninth of Kratos' benchmarks.

Rigid impacts have no size: radii are ours, spins those of the sources over the ratio of radii.
"""

from collections.abc import Sequence
from math import cos, inf, radians, sin

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.families.literature import PERCENT, TAG, UP, even
from touchstone.scenarios.scenario import Arc, Body, PairCoefficients, Scenario, Truth, Vector, vector
from touchstone.scenarios.solids import ball, slab
from touchstone.scenarios.truths.published import Published, Quantity

RADIUS = 0.05
"""Of the balls [m]; they have 1 kg."""
MET, PLAYED = 0.0521, 0.15
"""Time of the impacts, within a step of every engine, and end of the scenes [s]."""
LANE, HIGH = 0.4, 1.0
"""Distance between impacts of a scene, and height of those between balls [m]."""
Flying = tuple[Vector, Vector]
"""Velocity [m/s] and angular velocity [rad/s]."""
Flight = tuple[Body, Truth]
STILL: Vector = (0.0, 0.0, 0.0)
AHEAD: Vector = (1.0, 0.0, 0.0)
ACROSS: Vector = (0.0, 1.0, 0.0)

RESTITUTION, FRICTION, FAST = 0.98, 0.092, 3.9
"""Of a ball of aluminium oxide on glass, and its speed [m/s]."""
LARGER = 20.0
"""Ratio of our ball's radius to that of the source."""
CURVE: dict[int, tuple[float, float]] = {
    35: (0.7372, 582.26),
    40: (0.7809, 544.80),
    50: (0.8451, 457.03),
    60: (0.8929, 357.49),
    70: (0.9316, 246.18),
    80: (0.9662, 126.30),
    85: (0.9827, 63.15),
}
"""Angle from the normal [degrees] -> tangential restitution [1] and final spin [rad/s], in gross slip."""
READ = (0.005, 4.0)
"""How well values are read from the figures [1, rad/s]: half a percent of their axes."""
STICKS = (10, 20, 30)
"""Angles at which a rigid ball stops slipping in the impact: tan(angle) < 7/2 mu (1 + e) [degrees]."""
CHUNG = (
    "Chung & Ooi (2011), Granular Matter 13, 643, test 4: gross slip, as read from the figures by "
    "KratosMultiphysics (benchmark4_graph*_ref.dat); radius 50 mm, spins over 20"
)
WALTON = (
    "Walton (1993), Mech. Mater. 16, 239: a rigid ball (beta_0 = 0) sticks: v_t' = 5/7 v_t = r w. "
    "Chung & Ooi (2011) disagree: 0.687, 0.616 and 0.684 of v_t at 10, 20 and 30°, by tangential elasticity, "
    "which a rigid body has not"
)


@scene
def oblique_impacts() -> Scenario:
    """Balls hit a floor at ten angles: steep ones stick, others slip throughout."""
    flights, published = [], []
    for k, angle in enumerate((*STICKS, *CURVE)):
        a, name = radians(angle), f"ball_{angle}"
        fast, down = FAST * sin(a), FAST * cos(a)
        flights.append(_onto_floor(name, "oxide", k, (fast, down, 0.0), FRICTION, RESTITUTION))
        if angle in CURVE:
            (ratio, turns), (read, blur), source = CURVE[angle], READ, CHUNG
            values = (ratio * fast, read * fast), (turns / LARGER, blur / LARGER)
        else:
            source = WALTON
            rolling = 5 / 7 * fast
            values = (rolling, PERCENT * rolling), (rolling / RADIUS, PERCENT * rolling / RADIUS)
        published += [
            _after(f"{angle}° speed", name, "velocity", values[0], source),
            _after(f"{angle}° spin", name, "spin", values[1], source, ACROSS),
        ]
    return _scene(
        "oblique_impacts",
        f"balls hit a floor at {STICKS[0]} to 85 degrees from its normal and stick or slip",
        "glass",
        flights,
        even("glass", "oxide", mu=FRICTION, e=RESTITUTION),
        published,
    )


SLOW = 0.4
"""Speed along the normal of tests 2, 6 and 8 [m/s]: twice the source's, at which DART and Bullet begin to
bounce, so that rounding would decide; rigid impacts have no speed either."""
COEFFICIENTS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Restitutions of test 3 and of benchmark 9 [1]."""
HEAD_ON, THIRD = 10.0, 3.9
"""Speeds of each of two balls (test 1), of test 3, and of benchmark 9 here [m/s]."""
NORMAL = (
    "Chung & Ooi (2011), Granular Matter 13, 643, tests 1 to 3, and benchmark 9 of KratosMultiphysics: along "
    "the normal an impact returns e times the speed. Tolerance 1 % of the speed"
)


@scene
def normal_impacts() -> Scenario:
    """Balls hit a floor, and each other, along the normal, with restitutions from 0 to 1."""
    flights, published = [], []
    shares = {"hard": 1.0} | {f"e_{round(10 * e)}": e for e in COEFFICIENTS}
    for k, (material, e) in enumerate(shares.items()):
        does = f"e {e:g}" if k else "elastic"
        onto, each = (THIRD, THIRD) if k else (SLOW, HEAD_ON)
        flights.append(_onto_floor(f"ball_{k + 1}", material, k, (0.0, onto, 0.0), 0.0, e))
        flights += _head_on(k, ("hard", material), each, 0.0, e)
        published += [
            _after(f"floor {does}", f"ball_{k + 1}", "velocity", (e * onto, PERCENT * onto), NORMAL, UP),
            _after(f"pair {does}", f"right_{k + 1}", "velocity", (e * each, PERCENT * each), NORMAL),
        ]
    names = sorted(shares)
    # those that never meet have what engines that multiply would give them
    pairs = [(a, b) for k, a in enumerate(names) for b in names[k:]]
    return _scene(
        "normal_impacts",
        "balls hit a floor and each other along the normal, with e of 0 to 1",
        "hard",
        flights,
        tuple(PairCoefficients(a, b, shares[a] * shares[b], 0.0) for a, b in pairs),
        published,
    )


ELASTIC, ONWARD = 0.3, 5.0
"""Friction of elastic balls (tests 5 and 7) [1], and their speed onto the floor (test 5) [m/s]."""
SLIPS = {10.0: 5.0041, 20.0: 4.9905}
"""Slip over mu times the speed onto the floor -> final spin, times r, over the same (test 5, steel) [1]."""
ROLLS = (2.0, 5.0)
"""Slips over the same at which a rigid ball ends rolling: less than 7/2 (1 + e) [1]."""
BLURRED = 0.05
"""How well these are read from figures [1]: 1 % of their axis."""
MEETING, SPINS = 0.2, (2.0, 22.86)
"""Speed of each of two balls that meet [m/s], and their spins (test 7) [rad/s]."""
FIFTH = (
    "Chung & Ooi (2011), Granular Matter 13, 643, test 5: gross slip of steel, as read from the figures by "
    "KratosMultiphysics (benchmark5_graph2.dat); radius 50 mm, spins over 5000"
)
FIFTH_STICKS = (
    "Walton (1993), Mech. Mater. 16, 239: a rigid ball sticks, r w = 5/7 of the slip. Chung & Ooi (2011), "
    "test 5, disagree: 2.524 and 5.007 times mu v in place of 1.429 and 3.571, by tangential elasticity"
)
SEVENTH = (
    "Chung & Ooi (2011), Granular Matter 13, 643, test 7: equal balls with opposite spins meet without slip "
    "and keep them (benchmark7_graph2.dat of KratosMultiphysics). Tolerance 1 %"
)


@scene
def elastic_impacts() -> Scenario:
    """Elastic balls slide onto a floor; others meet with opposite spins, which they keep."""
    flights, published = [], []
    unit = ELASTIC * ONWARD
    for k, slip in enumerate((*ROLLS, *SLIPS)):
        name = f"ball_{slip:g}"
        flights.append(_onto_floor(name, "steel", k, (slip * unit, ONWARD, 0.0), ELASTIC, 1.0))
        value, blur, source = 5 / 7 * slip, PERCENT * 5 / 7 * slip, FIFTH_STICKS
        if slip in SLIPS:
            value, blur, source = SLIPS[slip], BLURRED, FIFTH
        values = (value * unit / RADIUS, blur * unit / RADIUS)
        published.append(_after(f"slip {slip:g} spin", name, "spin", values, source, ACROSS))
    for k, spin in enumerate(SPINS):
        flights += _head_on(k, ("steel", "steel"), MEETING, spin, 1.0)
        name, values = f"pair {spin:.3g} spin", (spin, PERCENT * spin)
        published.append(_after(name, f"left_{k + 1}", "spin", values, SEVENTH, ACROSS))
    return _scene(
        "elastic_impacts",
        "elastic balls slide onto a floor, and meet each other with opposite spins",
        "steel",
        flights,
        even("steel", mu=ELASTIC, e=1.0),
        published,
    )


ALLOY, GRIPS = 0.5, 0.4
"""Restitution and friction of an alloy (tests 6 and 8) [1]."""
BETAS = {0.1872: -0.8152, 0.3583: -0.6262, 0.5508: -0.4394, 0.7647: -0.2378, 0.9786: -0.0173}
"""7/2 mu (1 + e) v over the slip -> minus the slip after over that before [1]."""
STUCK = 2.0909
"""The same where a rigid ball sticks [1]."""
TANGENTIAL = 0.016
"""How well these are read from figures [1]: 1 % of their axis."""
HEAVIER, GREATER = 125_000.0, 5.0
"""Mass and radius of the large ball of test 8 over those of the small one [1]."""
SIXTH = (
    "Chung & Ooi (2011), Granular Matter 13, 643, tests 6 and 8: a ball that spins, without sliding, hits a "
    "wall and a large ball; gross slip of aluminium alloy, as read from the figures by KratosMultiphysics "
    "(benchmark8_graph1.dat): v_t = 2/7 r w (1 + beta)"
)
SIXTH_STICKS = (
    "Walton (1993), Mech. Mater. 16, 239: a rigid ball sticks, v_t = 2/7 r w. Chung & Ooi (2011), tests 6 "
    "and 8, disagree: 1.058 times that, by tangential elasticity"
)


@scene
def spinning_impacts() -> Scenario:
    """Balls that spin hit a floor, and balls of 125,000 times their mass, which throw them sideways."""
    flights, published = [], []
    for k, (share, beta) in enumerate({**BETAS, STUCK: 0.0}.items()):
        slip = 7 / 2 * GRIPS * (1 + ALLOY) * SLOW / share
        spin, thrown = slip / RADIUS, 2 / 7 * slip * (1 + beta)
        flights.append(_onto_floor(f"ball_{k + 1}", "alloy", k, (0.0, SLOW, spin), GRIPS, ALLOY))
        flights += _onto_large(k, spin)
        source, blur = (SIXTH, TANGENTIAL) if share in BETAS else (SIXTH_STICKS, PERCENT)
        values = (thrown, 2 / 7 * slip * blur)
        published += [
            _after(f"{does} {spin:.3g} rad/s", f"{name}_{k + 1}", "velocity", values, source)
            for does, name in (("floor", "ball"), ("large", "small"))
        ]
    return _scene(
        "spinning_impacts",
        "balls that spin hit a floor and large balls, which throw them sideways",
        "alloy",
        flights,
        even("alloy", mu=GRIPS, e=ALLOY),
        published,
    )


def _impulses(speed: float, slip: float, mu: float, e: float, heavier: float = inf) -> tuple[float, float]:
    """Impulses along the normal and against the slip on a ball of 1 kg [N s] that hits a ball at rest of
    `heavier` times its mass: Newton's restitution, and friction that at most ends the slip."""
    mass = 1 / (1 + 1 / heavier)
    pressed = (1 + e) * mass * speed
    return pressed, min(mu * pressed, 2 / 7 * mass * abs(slip))


def _onto_floor(
    name: str, material: str, lane: int, before: tuple[float, float, float], mu: float, e: float
) -> Flight:
    """A ball that hits the floor with a speed along x, a speed down [m/s] and a spin about y [rad/s]."""
    along, down, spin = before
    slip = along - RADIUS * spin
    pressed, rubbed = _impulses(down, slip, mu, e)
    rubbed = -rubbed if slip > 0 else rubbed
    after = (along + rubbed, 0.0, pressed - down), (0.0, spin - 5 / 2 * rubbed / RADIUS, 0.0)
    place = (along * MET, LANE * lane, RADIUS)
    return _flight(name, material, place, ((along, 0.0, -down), (0.0, spin, 0.0)), after)


def _head_on(lane: int, materials: tuple[str, str], speed: float, spin: float, e: float) -> list[Flight]:
    """Balls that meet with a speed each [m/s] and opposite spins about y [rad/s]: no slip."""
    return [
        _flight(
            f"{side}_{lane + 1}",
            material,
            (-sign * RADIUS, -LANE * (lane + 1), HIGH),
            ((sign * speed, 0.0, 0.0), (0.0, sign * spin, 0.0)),
            ((-sign * e * speed, 0.0, 0.0), (0.0, sign * spin, 0.0)),
        )
        for side, material, sign in zip(("left", "right"), materials, (1.0, -1.0))
    ]


def _onto_large(lane: int, spin: float) -> list[Flight]:
    """A ball that spins about z [rad/s] and hits a large one along y."""
    pressed, rubbed = _impulses(SLOW, RADIUS * spin, GRIPS, ALLOY, HEAVIER)
    x, large = -1.0 * (lane + 1), GREATER * RADIUS
    after = (rubbed, SLOW - pressed, 0.0), (0.0, 0.0, spin - 5 / 2 * rubbed / RADIUS)
    pushed = (-rubbed / HEAVIER, pressed / HEAVIER, 0.0), (0.0, 0.0, -5 / 2 * rubbed / HEAVIER / large)
    at, there = (x, -RADIUS, HIGH), (x, large, HIGH)
    return [
        _flight(f"small_{lane + 1}", "alloy", at, ((0.0, SLOW, 0.0), (0.0, 0.0, spin)), after),
        _flight(f"large_{lane + 1}", "alloy", there, (STILL, STILL), pushed, (large, HEAVIER)),
    ]


def _flight(
    name: str,
    material: str,
    place: Vector,
    before: Flying,
    after: Flying,
    size: tuple[float, float] = (RADIUS, 1.0),
) -> Flight:
    """A ball of some radius [m] and mass [kg] that meets something at MET at `place`, and its truth."""
    (velocity, spin), (departs, turns) = before, after
    start = vector([x - MET * v for x, v in zip(place, velocity)])
    arcs = (
        Arc(0.0, start, velocity, angular_velocity=spin),
        Arc(MET, place, departs, angular_velocity=turns),
    )
    return ball(name, material, *size, start, velocity, spin), Truth(name, "arcs", arcs)


def _after(
    name: str, body: str, quantity: Quantity, value: tuple[float, float], source: str, along: Vector = AHEAD
) -> Published:
    """A published value and its tolerance at the end of a scene."""
    return Published(name, body, quantity, *value, source, PLAYED, PLAYED, along)


def _scene(
    name: str,
    summary: str,
    floor: str,
    flights: Sequence[Flight],
    coefficients: tuple[PairCoefficients, ...],
    published: Sequence[Published],
) -> Scenario:
    bodies, truths = zip(*flights)
    return Scenario(
        name=name,
        summary=summary,
        tags=(TAG,),
        bodies=(slab("floor", floor), *bodies),
        coefficients=coefficients,
        duration=PLAYED,
        effects=("restitution", "friction"),
        truths=truths,
        published=tuple(published),
    )
