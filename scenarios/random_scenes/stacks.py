"""Random scenes whose bodies stand on, bridge or lean on each other."""

from math import pi

import numpy as np
from numpy.random import Generator

from touchstone.scenarios.random_scenes.bodies import (
    FLAT,
    MATERIAL,
    masses,
    random_shape,
    solid,
    support,
    turned,
)
from touchstone.scenarios.random_scenes.setup import (
    DOWN,
    JITTER,
    SIZE,
    Setup,
    Y,
    mass_ratio,
    random_box,
    random_gap,
    random_size,
    random_yaw,
    stacked,
)
from touchstone.scenarios.scenario import IDENTITY, Body, Box, Capsule, Shape, Sphere
from touchstone.scenarios.solids import block, slab


def drops(rng: Generator) -> Setup:
    """Stacked boxes off centre, sometimes with another shape on top, dropped from up to 5 cm."""
    count = int(rng.integers(2, 7))
    shapes: list[Shape] = [random_box(rng, random_size(rng)) for _ in range(count)]
    if rng.random() < 0.3:
        shapes[-1] = random_shape(rng, random_size(rng))
    turns = [random_yaw(rng) for _ in shapes]
    gaps = [random_gap(rng) for _ in shapes]
    heights = stacked(shapes, turns, gaps, 0.0)
    places = np.cumsum(rng.uniform(-0.6, 0.6, (count, 2)) * np.mean(SIZE), axis=0)
    loads = masses(rng, count, mass_ratio(rng))
    bodies = [
        solid(f"body_{k + 1}", shapes[k], loads[k], (float(x), float(y), heights[k]), turns[k])
        for k, (x, y) in enumerate(places)
    ]
    return Setup(f"{count} bodies dropped on each other", [slab("floor", MATERIAL), *bodies])


def towers(rng: Generator) -> Setup:
    """Stacked boxes in contact, aligned to within 2 mm."""
    count = int(rng.integers(3, 13))
    size, jitter = random_size(rng), float(rng.choice([0.0, rng.uniform(0, JITTER)]))
    cubes = rng.random() < 0.6
    shapes: list[Shape] = [Box((size, size, size)) if cubes else random_box(rng, size) for _ in range(count)]
    turns = [random_yaw(rng, 0.05) for _ in shapes]
    heights = stacked(shapes, turns, [0.0] * count, 0.0)
    places = rng.uniform(-jitter, jitter, (count, 2))
    loads = masses(rng, count, mass_ratio(rng))
    order = rng.choice(["random", "heavy_top", "heavy_bottom"])
    if order != "random":
        loads = sorted(loads, reverse=bool(order == "heavy_bottom"))
    bodies = [
        solid(f"box_{k + 1}", shapes[k], loads[k], (float(x), float(y), heights[k]), turns[k])
        for k, (x, y) in enumerate(places)
    ]
    summary = f"tower of {count} boxes, jitter {jitter * 1e3:.2g} mm, masses {order}"
    return Setup(summary, [slab("floor", MATERIAL), *bodies])


def ratios(rng: Generator) -> Setup:
    """A body on one to four light ones side by side, with a mass ratio of up to 1e4."""
    count, size = int(rng.integers(1, 5)), random_size(rng)
    ratio = float(10.0 ** rng.uniform(2, 4))
    round_ones = rng.random() < 0.4
    shape: Shape = Sphere(size) if round_ones else Box((size, size, size))
    corners = [(x * size * 1.5, y * size * 1.5) for x in (-1, 1) for y in (-1, 1)]
    places = {1: [(0.0, 0.0)], 2: corners[::3], 3: corners[:3], 4: corners}[count]
    light = [solid(f"light_{k + 1}", shape, 1.0, (x, y, size)) for k, (x, y) in enumerate(places)]
    top = Box((3 * size, 3 * size, float(rng.uniform(0.5, 2)) * size))
    height = 2 * size + random_gap(rng, 0.01) + top.half_extents[2]
    heavy = solid("heavy", top, ratio, (0.0, 0.0, height))
    return Setup(f"{ratio:.3g} kg on {count} of 1 kg", [slab("floor", MATERIAL), *light, heavy])


def bridges(rng: Generator) -> Setup:
    """A plank over two blocks, with up to three bodies on it."""
    size, loaded = random_size(rng), int(rng.integers(0, 4))
    pier, apart = Box((size, size, size * float(rng.uniform(0.5, 2)))), float(rng.uniform(3, 6)) * size
    plank = Box((apart * float(rng.uniform(0.6, 1.2)), size, size * float(rng.uniform(0.1, 0.4))))
    shapes: list[Shape] = [plank, *(random_shape(rng, size, (*FLAT, "sphere")) for _ in range(loaded))]
    loads = masses(rng, 3 + loaded, mass_ratio(rng))
    piers = [
        solid(f"pier_{k + 1}", pier, loads[k], (side * apart / 2, 0.0, pier.half_extents[2]))
        for k, side in enumerate((-1, 1))
    ]
    gaps = [random_gap(rng, 0.01), *(random_gap(rng) for _ in range(loaded))]
    heights = stacked(shapes, [IDENTITY] * len(shapes), gaps, 2 * pier.half_extents[2])
    along = [0.0, *(rng.uniform(-0.8, 0.8, loaded) * plank.half_extents[0])]
    above = [
        solid("plank" if k == 0 else f"load_{k}", shapes[k], loads[2 + k], (float(along[k]), 0.0, heights[k]))
        for k in range(1 + loaded)
    ]
    return Setup(f"a plank over two blocks with {loaded} loads", [slab("floor", MATERIAL), *piers, *above])


def leaning(rng: Generator) -> Setup:
    """Rods that lean side by side on a wall, or pairs that lean on each other."""
    count, size = int(rng.integers(1, 5)), random_size(rng)
    card_house = rng.random() < 0.5
    bodies: list[Body] = [slab("floor", MATERIAL)]
    if not card_house:
        bodies.append(slab("wall", MATERIAL, (-1.0, 0.0, 0.0), turned(Y, -pi / 2)))
        count += 1
    loads = masses(rng, 2 * count, mass_ratio(rng))
    for k in range(count):
        long, thin = 3 * size, size * float(rng.uniform(0.1, 0.4))
        rod: Shape = Box((thin, size, long)) if rng.random() < 0.6 else Capsule(thin, long)
        tilt, gap = float(rng.uniform(0.05, 1.2)), random_gap(rng, 1e-3)
        for side in (1, -1) if card_house else (1,):
            turn = turned(Y, side * tilt)
            x = -side * (support(rod, turn, (float(side), 0.0, 0.0)) + gap / 2)
            place = (x, 2.2 * size * k, support(rod, turn, DOWN))
            bodies.append(solid(f"rod_{len(bodies)}", rod, loads[2 * k + (side < 0)], place, turn))
    what = f"{count} pairs of rods lean on each other" if card_house else f"{count} rods lean on a wall"
    return Setup(what, bodies)


def slots(rng: Generator) -> Setup:
    """Boxes that fit between two walls, exactly or with a clearance of up to 1 mm, and a body that falls on
    them."""
    count, size = int(rng.integers(1, 5)), random_size(rng)
    spare = float(rng.choice([0.0, 1e-9, 1e-6, 1e-4, 1e-3]))
    shapes: list[Shape] = [
        Box((size, size * float(rng.uniform(0.4, 2)), size * float(rng.uniform(0.4, 2))))
        for _ in range(count)
    ]
    if rng.random() < 0.4:
        shapes[0] = Sphere(size)
    shapes.append(random_shape(rng, size, ("sphere", "box", "capsule", "ellipsoid")))
    heights = stacked(shapes, [IDENTITY] * len(shapes), [random_gap(rng) for _ in shapes], 0.0)
    loads = masses(rng, len(shapes), mass_ratio(rng))
    bodies = [
        solid(f"body_{k + 1}", shape, loads[k], (0.0, 0.0, heights[k])) for k, shape in enumerate(shapes)
    ]
    thick, half = 0.05, heights[-1]
    walls = [
        block(
            name, MATERIAL, (thick, 1.0, half), 0.0, (side * (size + spare + thick), 0.0, half), kind="fixed"
        )
        for name, side in (("west", -1), ("east", 1))
    ]
    summary = f"{count} bodies between two walls, {spare:g} m to spare on either side"
    return Setup(summary, [slab("floor", MATERIAL), *walls, *bodies])
