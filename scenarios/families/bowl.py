"""`bowl` and `bowl_of_balls`: a ball rolls to and fro in a hollow of flat pieces, and over a row of balls."""

from dataclasses import dataclass
from math import cos, radians, sin, sqrt, tan

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import (
    GRAVITY,
    Arc,
    Body,
    Box,
    PairCoefficients,
    Piece,
    Scenario,
    Sphere,
    Truth,
    Vector,
)
from touchstone.scenarios.solids import ball

HOLLOW, BALL = 0.5, 0.1
"""Radii of the circle that the pieces touch from outside, and of the ball [m]."""
FACETS, TURN = 7, radians(20.0)
"""Number of pieces, and angle between neighbours [rad]; the middle one is level."""
HALF_WIDTH, HALF_THICKNESS = 0.3, 0.02
"""Of a piece, along the hollow's axis and across its face [m]."""
REACH = (HOLLOW - BALL) * tan(TURN / 2)
"""Half the length of the centre's way over one piece [m]."""
KEPT = (5 * cos(TURN) + 2) / 7
"""Share of the speed that the ball keeps where it meets the next piece: there it has the angular momentum
m r v cos(TURN) + I v / r, and rolls on with 7/5 m r v'."""
DURATION = 2.0


@dataclass(frozen=True, slots=True)
class Roll:
    """Roll over a piece: time of its start [s], number of the piece from the middle, place along it from its
    middle [m], speed and acceleration."""

    start: float
    facet: int
    place: float
    speed: float
    acceleration: float

    def leaves(self) -> float:
        """Time after the start at which the ball meets a neighbour of the piece [s]."""
        times = []
        for end in (-REACH, REACH):
            if self.acceleration == 0:
                times.append((end - self.place) / self.speed)
                continue
            square = self.speed**2 + 2 * self.acceleration * (end - self.place)
            if square >= 0:
                times += [(s * sqrt(square) - self.speed) / self.acceleration for s in (-1, 1)]
        # the root at its own start is 0 to rounding
        return min(time for time in times if time > 1e-9)


@scene
def bowl() -> Scenario:
    """Released on the piece that is two above the middle; each piece that it meets takes some speed."""
    pieces = tuple(
        Piece(
            f"piece_{k + FACETS // 2 + 1}",
            Box((HOLLOW * tan(TURN / 2), HALF_WIDTH, HALF_THICKNESS)),
            _at(k, 0.0, HOLLOW + HALF_THICKNESS),
            (cos(k * TURN / 2), 0.0, -sin(k * TURN / 2), 0.0),
        )
        for k in range(-(FACETS // 2), FACETS // 2 + 1)
    )
    arcs = tuple(map(_arc, rolls()))
    return Scenario(
        name="bowl",
        summary="a ball rolls to and fro in a hollow of flat pieces",
        tags=("curved",),
        bodies=(
            Body("bowl", "fixed", "wood", pieces),
            ball("ball", "wood", BALL, 1.0, arcs[0].position),
        ),
        coefficients=(PairCoefficients("wood", "wood", 0.0, 0.8),),
        duration=DURATION,
        truths=(Truth("ball", "arcs", arcs),),
    )


def rolls() -> list[Roll]:
    """The ball's way from piece to piece, from rest in the middle of one."""
    found = [Roll(0.0, 2, 0.0, 0.0, _pull(2))]
    while True:
        last = found[-1]
        time = last.leaves()
        if last.start + time > DURATION:
            return found
        speed = last.speed + last.acceleration * time
        side = 1 if speed > 0 else -1
        facet = last.facet + side
        found.append(Roll(last.start + time, facet, -side * REACH, KEPT * speed, _pull(facet)))


def _pull(facet: int) -> float:
    """Acceleration along a piece [m/s^2]: 5/7 of gravity's share for a ball that rolls."""
    return -5 / 7 * GRAVITY * sin(facet * TURN)


def _at(facet: int, along: float, away: float) -> Vector:
    """A point at a distance along a piece from its middle, and away from the hollow's axis [m]."""
    c, s = cos(facet * TURN), sin(facet * TURN)
    return (along * c + away * s, 0.0, along * s - away * c)


def _arc(roll: Roll) -> Arc:
    c, s = cos(roll.facet * TURN), sin(roll.facet * TURN)
    return Arc(
        roll.start,
        _at(roll.facet, roll.place, HOLLOW - BALL),
        (roll.speed * c, 0.0, roll.speed * s),
        (roll.acceleration * c, 0.0, roll.acceleration * s),
        (0.0, roll.speed / BALL, 0.0),
        (0.0, roll.acceleration / BALL, 0.0),
    )


ROW, STONE = 1.0, 0.15
"""Radii of the circle that the row's centres lie on, and of its balls [m]."""
STONES, GAP = 11, radians(6.0)
"""Number of balls in the row, and angle between neighbours about the circle's centre [rad]."""
LEAN = radians(25.0)
"""Angle at which the ball starts on its first ball, from the vertical towards the middle [rad]."""


@scene
def bowl_of_balls() -> Scenario:
    """It rolls over each ball of the row and loses speed where it meets the next."""
    middle = STONES // 2
    angles = [GAP * k for k in range(-middle, middle + 1)]
    row = tuple(
        Piece(f"ball_{k + 1}", Sphere(STONE), (ROW * sin(a), 0.0, -ROW * cos(a)))
        for k, a in enumerate(angles)
    )
    # on the last ball but one, towards the middle
    start, inward = angles[-2], STONE + BALL
    place = (ROW * sin(start) - inward * sin(LEAN), 0.0, -ROW * cos(start) + inward * cos(LEAN))
    return Scenario(
        name="bowl_of_balls",
        summary="a ball rolls to and fro over a row of balls",
        tags=("curved",),
        bodies=(Body("row", "fixed", "wood", row), ball("ball", "wood", BALL, 1.0, place)),
        coefficients=(PairCoefficients("wood", "wood", 0.0, 0.8),),
        duration=DURATION,
        truths=(Truth("ball", "smooth_contact"),),
    )
