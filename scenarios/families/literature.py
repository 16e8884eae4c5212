"""Scenes made for published values: ramps, a rocking block, rings, discs, a force plate, Painleve's rod.

`ball_impacts.py` has those of impacts, `platform.py` those of carried loads; other families state published
values beside their truths.
"""

from dataclasses import replace
from math import acosh, atan, cos, pi, radians, sin, sqrt, tan

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.families.ellipsoid import contact_arm
from touchstone.scenarios.orientations import about_y, quaternion
from touchstone.scenarios.scenario import (
    GRAVITY,
    Arc,
    Body,
    PairCoefficients,
    Piece,
    Quaternion,
    Scenario,
    Sphere,
    Truth,
    Vector,
    vector,
)
from touchstone.scenarios.solids import ball, block, ellipsoid, hull, slab
from touchstone.scenarios.truths.published import Published

TAG = "literature"
PERCENT = 0.01
"""Tolerance of a closed form in a source that states none, as a share of it [1]: that of Newton's tests."""
UP: Vector = (0.0, 0.0, 1.0)


def even(*materials: str, mu: float, e: float = 0.0) -> tuple[PairCoefficients, ...]:
    """The same coefficients for a material or two, on themselves and on each other."""
    pairs = {tuple(sorted((a, b))) for a in materials for b in materials}
    return tuple(PairCoefficients(a, b, e, mu) for a, b in sorted(pairs))


RAMP: Vector = (6.0, 0.3, 0.5)
"""Half extents of a ramp [m]; neighbours are a metre apart."""
FLAT: Vector = (0.1, 0.1, 0.05)
"""Half extents of a box on a ramp [m], in the proportions of Newton's test."""
ANGLES, FRICTIONS = (0, 5, 10, 15, 20, 30, 40), (0.1, 0.2, 0.3, 0.4, 0.5, 0.7)
"""Angles of the ramps [degrees], and friction of the boxes on them [1]."""
SPEED, PLAYED = 1.0, 1.2
"""First speed of the boxes down their ramps [m/s], and the time after which they are measured [s]."""
COULOMB = (
    "Coulomb (1785), Théorie des machines simples: down a slope a = g (sin - mu cos), and what stops rests; "
    "grid and tolerance of 1 %: Newton's test_rigid_friction_ramp.py, which releases boxes from rest"
)


@scene
def ramps() -> tuple[Scenario, ...]:
    """Boxes slide down seven ramps; they stop where tan(angle) < mu; on the steepest of these a box rests."""
    return tuple(map(_ramps, FRICTIONS))


def _ramps(mu: float) -> Scenario:
    bodies, truths, published = [], [], []
    steepest = max(angle for angle in ANGLES if tan(radians(angle)) < mu)
    for k, angle in enumerate(ANGLES):
        ramp, turn, along, up = _ramp(k, angle)
        bodies.append(ramp)
        steepness = radians(angle)
        pull = GRAVITY * (sin(steepness) - mu * cos(steepness))
        for name, first in ((f"box_{angle}", SPEED), *(((f"rests_{angle}", 0.0),) * (angle == steepest))):
            start = k * np.array((0.0, 1.0, 0.0)) + FLAT[2] * up - (1.0 - first) * along
            stop = -first / pull if pull < 0 else 2 * PLAYED
            time = min(stop, PLAYED)
            value = first * time + (pull if first else 0.0) * time**2 / 2
            still = Arc(stop, vector(start + first * stop / 2 * along))
            slides = Arc(0.0, vector(start), vector(first * along), vector(pull * along))
            arcs = (slides, still) if stop else (replace(still, start=0.0),)
            bodies.append(block(name, "wood", FLAT, 1.0, vector(start), turn, velocity=vector(first * along)))
            truths.append(Truth(name, "arcs", arcs))
            does = "rests" if not first else "stops" if stop < PLAYED else "slides"
            tolerance = PERCENT * value or 1e-3
            published.append(
                Published(f"{angle}° {does}", name, "distance", value, tolerance, COULOMB, 0.0, PLAYED)
            )
    return Scenario(
        name=f"ramps_mu{mu:g}".replace(".", ""),
        summary=f"boxes slide down ramps of {ANGLES[0]} to {ANGLES[-1]} degrees with mu = {mu:g}",
        tags=(TAG,),
        bodies=tuple(bodies),
        coefficients=even("wood", mu=mu),
        duration=PLAYED,
        truths=tuple(truths),
        published=tuple(published),
    )


def _ramp(lane: int, angle: float) -> tuple[Body, Quaternion, np.ndarray, np.ndarray]:
    """A ramp whose upper face passes through (0, lane, 0), its orientation, and its directions."""
    turn = about_y(radians(angle))
    along, _, up = Rotation.from_quat(turn, scalar_first=True).as_matrix().T
    place = vector(lane * np.array((0.0, 1.0, 0.0)) - RAMP[2] * up)
    return block(f"ramp_{angle}", "wood", RAMP, 0.0, place, turn, kind="fixed"), turn, along, up


ROLLS, SLIPS, THIN = 10, 40, 0.1
"""Angles at which balls of friction THIN roll and slip [degrees]: solid ones slip where tan(angle) > 7/2 mu,
shells where it is over 5/2 mu."""
CRAWFORD = (
    "Crawford (1996), Am. J. Phys. 64, 541: a = g sin / (1 + b) rolling, b = 2/5 of a solid ball, 2/3 of a "
    "shell; slipping, a = g (sin - mu cos) and r w' = mu g cos / b"
)


@scene
def balls_on_ramps() -> Scenario:
    """A solid ball and a shell roll down a gentle ramp and slip down a steep one."""
    bodies, truths, published = [], [], []
    radius, played = 0.1, 1.0
    for k, angle in enumerate((ROLLS, SLIPS)):
        ramp, _, along, up = _ramp(k, angle)
        bodies.append(ramp)
        pull, press = GRAVITY * sin(radians(angle)), GRAVITY * cos(radians(angle))
        for name, share, place in (("solid", 2 / 5, 0.0), ("shell", 2 / 3, -0.5)):
            rolls = angle == ROLLS
            a = pull / (1 + share) if rolls else pull - THIN * press
            turning = a / radius if rolls else THIN * press / (share * radius)
            start = vector(k * np.array((0.0, 1.0, 0.0)) + radius * up + place * along)
            plain, moment = ball(f"{name}_{angle}", "wood", radius, 1.0, start), share * radius**2
            inertia = ((moment, 0.0, 0.0), (0.0, moment, 0.0), (0.0, 0.0, moment))
            bodies.append(replace(plain, inertia=inertia))
            spin = (0.0, turning, 0.0)
            arc = Arc(0.0, start, acceleration=vector(a * along), angular_acceleration=spin)
            truths.append(Truth(plain.name, "arcs", (arc,)))
            for does, quantity, value in (
                ("rolls" if rolls else "slips", "distance", a * played**2 / 2),
                *((("spins", "spin", turning * played),) if not rolls else ()),
            ):
                window = (0.0 if quantity == "distance" else played, played)
                published.append(
                    Published(
                        f"{name} {does}", plain.name, quantity, value, PERCENT * value, CRAWFORD, *window,
                        along=(0.0, 1.0, 0.0),
                    )
                )  # fmt: skip
    return Scenario(
        name="balls_on_ramps",
        summary=f"balls roll down a ramp of {ROLLS} degrees and slip down one of {SLIPS}, mu = {THIN:g}",
        tags=(TAG,),
        bodies=tuple(bodies),
        coefficients=even("wood", mu=THIN),
        duration=played,
        truths=tuple(truths),
        published=tuple(published),
    )


BLOCK: Vector = (0.05, 0.1, 0.25)
"""Half extents of the rocking block [m]."""
LEANS = 0.5
"""First tilt over the one at which it would fall over [1]."""
HOUSNER = (
    "Housner (1963), Bull. Seismol. Soc. Am. 53, 403: after n impacts 1 - sqrt(1 - r^n (1 - (1 - p)^2)) of "
    "the critical angle, r = (1 - 3/2 sin^2)^2; slender blocks; as others quote it, the page of r was not "
    "seen. Tolerance 2 %: sin(a) = a up to 0.2"
)


@scene
def rocking_block() -> Scenario:
    """A tilted block rocks from edge to edge; each impact takes the same share of its energy."""
    b, _, h = BLOCK
    critical, reach = atan(b / h), sqrt(b * b + h * h)
    rate = sqrt(3 * GRAVITY / (4 * reach))
    kept = (1 - 3 / 2 * sin(critical) ** 2) ** 2
    tilts = [1 - sqrt(1 - kept**n * (1 - (1 - LEANS) ** 2)) for n in range(4)]
    quarters = [acosh(1 / (1 - tilt)) / rate for tilt in tilts]
    impacts = np.cumsum([quarters[0], *(2 * quarter for quarter in quarters[1:])])
    turn = Rotation.from_rotvec((0.0, LEANS * critical, 0.0))
    corners = [(x, y, z) for x in (-b, b) for y in (-BLOCK[1], BLOCK[1]) for z in (-h, h)]
    body = hull("block", "stone", corners, 1.0, vector(turn.apply((-b, 0.0, h))), quaternion(turn))
    return Scenario(
        name="rocking_block",
        summary="a slender block rocks from edge to edge",
        tags=(TAG,),
        bodies=(slab("floor", "stone"), body),
        coefficients=even("stone", mu=1.0),
        duration=1.5,
        truths=(Truth("block", "tipping"),),
        published=tuple(
            Published(
                f"tilt after {n}", "block", "tilt", tilt * critical, 0.02 * tilt * critical, HOUSNER,
                float(impacts[n - 1]), float(min(impacts[n], 1.5)),
            )
            for n, tilt in enumerate(tilts) if n
        ),
    )  # fmt: skip


VOYENLI = (
    "Voyenli & Eriksen (1985), Am. J. Phys. 53, 1149: a ring stops sliding and turning at the same time, and "
    "v / w goes to its radius from any start; as others quote it, their pages were not seen. On three feet "
    "it does, too (integrated). Tolerance 2 %"
)


@scene
def sliding_rings() -> Scenario:
    """Rings on three feet slide and spin; their mass is at floor level, so that the feet share it evenly."""
    radius, foot, mass = 0.1, 0.01, 1.0
    angles = 2 * pi * np.arange(3) / 3
    feet = tuple(
        Piece(f"foot_{k + 1}", Sphere(foot), vector((radius * cos(a), radius * sin(a), foot)))
        for k, a in enumerate(angles)
    )
    around = mass * radius**2
    rings = [
        Body(
            name, "simulated", "ice", feet, mass,
            inertia=((around / 2, 0.0, 0.0), (0.0, around / 2, 0.0), (0.0, 0.0, around)),
            position=(0.0, lane, 0.0),
            linear_velocity=(speed, 0.0, 0.0),
            angular_velocity=(0.0, 0.0, spin),
        )
        for name, lane, speed, spin in (("fast", 0.0, 1.0, 5.0), ("spinning", 1.0, 0.5, 10.0))
    ]  # fmt: skip
    return Scenario(
        name="sliding_rings",
        summary="rings on three feet slide and spin until both end at once",
        tags=(TAG,),
        bodies=(slab("floor", "ice"), *rings),
        coefficients=even("ice", mu=0.1),
        duration=1.2,
        published=tuple(
            Published(f"{ring.name} v / w", ring.name, "radius", radius, 0.02 * radius, VOYENLI, 1.2, 1.2)
            for ring in rings
        ),
    )


TILTS = (30, 45, 60)
"""Angles between the discs and the floor [degrees]."""
MOFFATT = (
    "Moffatt (2000), Nature 404, 833: a thin disc whose centre rests precesses at W^2 sin(a) = 4 g / R. "
    "Tolerance 1 %: ours is an ellipsoid with a rim of 2 % of its radius"
)


@scene
def euler_discs() -> Scenario:
    """Thin discs roll on their rims about centres at rest."""
    half, mass = (0.2, 0.2, 0.004), 1.0
    bodies, truths, published = [slab("floor", "steel")], [], []
    for k, tilt in enumerate(TILTS):
        turn, name = Rotation.from_rotvec((0.0, radians(tilt), 0.0)), f"disc_{tilt}"
        arm, rate = contact_arm(half, turn), sqrt(4 * GRAVITY / (half[0] * sin(radians(tilt))))
        # the disc turns about the line from its centre to the contact, at W sin(tilt)
        spin = -rate * sin(radians(tilt)) * arm / np.linalg.norm(arm)
        place = (0.0, float(k), -float(arm[2]))
        plain = ellipsoid(name, "steel", half, mass, place, quaternion(turn), spin=vector(spin))
        moment = mass * half[0] ** 2 / 4
        inertia = ((moment, 0.0, 0.0), (0.0, moment, 0.0), (0.0, 0.0, 2 * moment))
        bodies.append(replace(plain, inertia=inertia))
        truths.append(Truth(name, "smooth_contact"))
        published.append(
            Published(f"{tilt}° rate", name, "precession", rate, PERCENT * rate, MOFFATT, 0.0, 0.5)
        )
    return Scenario(
        name="euler_discs",
        summary="thin discs roll on their rims about centres at rest",
        tags=(TAG,),
        bodies=tuple(bodies),
        coefficients=even("steel", mu=1.0),
        duration=0.5,
        truths=tuple(truths),
        published=tuple(published),
    )


PLATED = (1.0, 2.0, 3.0)
"""Masses of the cubes on the force plate [kg]."""
CUBES, IMPACT_SPEED = 0.05, 1.0
"""Half extent of a cube [m], and speed with which it arrives [m/s]."""
LANDED = 0.5
"""Time within which the cubes come to rest, and that for which they then rest [s]."""
PLATE = (
    "Newton (1687), second law: the mean force is m (g + change of v / time), to 1 %. Issue 2630 of "
    "google-deepmind/mujoco (2025) asks it of such cubes, which it presses into the floor"
)


@scene
def force_plate() -> Scenario:
    """Cubes land on a plate and stay: it reads their change of momentum, then their weight."""
    bodies, published = [slab("plate", "steel")], []
    for k, mass in enumerate(PLATED):
        name, place = f"cube_{mass:g}", (0.5 * k, 0.0, CUBES)
        bodies.append(block(name, "rubber", (CUBES,) * 3, mass, place, velocity=(0.0, 0.0, -IMPACT_SPEED)))
        for does, start, gained in (("lands", 0.0, IMPACT_SPEED / LANDED), ("rests", LANDED, 0.0)):
            value = mass * (GRAVITY + gained)
            window = start, start + LANDED
            published.append(
                Published(
                    f"{mass:g} kg {does}",
                    name,
                    "force",
                    value,
                    PERCENT * value,
                    PLATE,
                    *window,
                    other="plate",
                )
            )
    return Scenario(
        name="force_plate",
        summary="cubes of 1 to 3 kg land on a plate that reads their force",
        tags=(TAG,),
        bodies=tuple(bodies),
        coefficients=even("rubber", "steel", mu=0.5),
        duration=2 * LANDED,
        published=tuple(published),
    )


ROD, TIP, SLIDING = 40.0, 0.04, 20.0
"""Half length of Painleve's rod and radius of its tip [m], so long that it hardly turns in two frames, and
first speed of the tip [m/s]."""
PRESSED = (1.0, 1.2)
"""Friction for which the rod has one motion [1], below 4/3."""
JAMMED = 1.5
"""Friction for which no finite force lets it slide on [1]: what an engine then does is the row's outcome."""
GENOT = (
    "Génot & Brogliato (1999), Eur. J. Mech. A 18, 653: F = m g / (1 + 3 cos (cos - mu sin)) on a slender "
    "rod, none beyond mu = 4/3 at tan = 2. Tolerance 3 %: F varies by 1 %"
)
LECORNU = (
    "Lecornu (1905), C. R. Acad. Sci. 140, 635: where no force is possible, an impact without collision "
    "stops the tip at once; Hogan & Kristiansen (2017) disagree: a compliant tip also lifts off"
)


@scene
def painleve_rods() -> tuple[Scenario, ...]:
    """A rod slides on its tip, away from its lean: friction presses the tip into the floor."""
    return tuple(map(_painleve, (*PRESSED, JAMMED)))


def _painleve(mu: float) -> Scenario:
    slope, played = atan(2), 1 / 30
    c, s = cos(slope), sin(slope)
    turn = Rotation.from_rotvec((0.0, pi / 2 - slope, 0.0))
    # the lowest point of the tip is the end of the rod
    tip = vector(turn.inv().apply((-ROD * c, 0.0, -ROD * s + TIP)))
    moment = ROD**2 / 3
    rod = Body(
        "rod", "simulated", "chalk", (Piece("tip", Sphere(TIP), tip),), 1.0,
        inertia=((moment, 0.0, 0.0), (0.0, moment, 0.0), (0.0, 0.0, moment / 1e3)),
        position=(ROD * c, 0.0, ROD * s),
        orientation=quaternion(turn),
        linear_velocity=(-SLIDING, 0.0, 0.0),
    )  # fmt: skip
    rise = GRAVITY * (1 / (1 + 3 * c * (c - mu * s)) - 1) * played
    # about the tip at rest, (1 + 1/3) m l^2 w = m l v sin
    value, source, along = (-3 / 4 * SLIDING * s * s, LECORNU, (1.0, 0.0, 0.0))
    if mu != JAMMED:
        value, source, along = rise, GENOT, UP
    return Scenario(
        name=f"painleve_mu{mu:g}".replace(".", ""),
        summary=f"a rod slides on its tip with mu = {mu:g}; beyond 4/3 no force lets it slide on",
        tags=(TAG,),
        bodies=(slab("floor", "chalk"), rod),
        coefficients=even("chalk", mu=mu),
        duration=played,
        truths=(Truth("rod", "smooth_contact"),) if mu != JAMMED else (),
        published=(
            Published(
                "rise" if mu != JAMMED else "stops", "rod", "velocity", value, 0.03 * abs(value), source,
                played, played, along,
                outcomes=() if mu != JAMMED else (("stops", value), ("slides on", -SLIDING)),
            ),
        ),
    )  # fmt: skip
