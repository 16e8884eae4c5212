"""`balls_box`: 216 balls fall into an open box and come to rest in it."""

import numpy as np

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import PairCoefficients, Scenario
from touchstone.scenarios.solids import ball, block

SIDE = 6
"""Number of balls along an edge of the falling cube."""
RADIUS, MASS = 0.05, 1.0
SPACING = 0.105
SCATTER = 2e-3
"""Maximum offset of a ball from its grid position, per axis [m]: without it, layers would land as one."""
DROP = 0.1
"""Drop height of the lowest layer [m]."""
ROOM = 0.34
"""Half the inner width of the box [m]: 5 cm more than the cube, so that the cube breaks up."""
WALL = 0.05
"""Half the thickness of a wall [m]."""
SEED = 0


@scene
def balls_box() -> Scenario:
    """A cube of balls in a seeded order, each with a seeded offset of a millimetre or two."""
    rng = np.random.default_rng(SEED)
    grid = np.stack(np.meshgrid(*[np.arange(SIDE)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    places = rng.permutation(SPACING * (grid - [(SIDE - 1) / 2, (SIDE - 1) / 2, 0]))
    places += [0, 0, RADIUS + DROP] + rng.uniform(-SCATTER, SCATTER, places.shape)
    height, out, across = SIDE * SPACING, ROOM + WALL, ROOM + 2 * WALL
    sides = {
        "floor": ((0.0, 0.0, -WALL), (across, across, WALL)),
        "west": ((-out, 0.0, height / 2), (WALL, across, height / 2)),
        "east": ((out, 0.0, height / 2), (WALL, across, height / 2)),
        "south": ((0.0, -out, height / 2), (across, WALL, height / 2)),
        "north": ((0.0, out, height / 2), (across, WALL, height / 2)),
    }
    return Scenario(
        name="balls_box",
        summary=f"{SIDE**3} balls fall into a box and come to rest in it",
        tags=("heap", "settles"),
        bodies=(
            *(block(name, "wood", half, 0.0, place, kind="fixed") for name, (place, half) in sides.items()),
            *(
                ball(f"ball_{k + 1}", "wood", RADIUS, MASS, (float(x), float(y), float(z)))
                for k, (x, y, z) in enumerate(places)
            ),
        ),
        coefficients=(PairCoefficients("wood", "wood", 0.3, 0.3),),
        duration=3.0,
        seed=SEED,
    )
