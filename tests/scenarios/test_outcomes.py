"""Final positions in closed form: those of the scenes' truths, and the factors known by hand."""

from dataclasses import replace

import numpy as np
import pytest

from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.closed_form_ends import final_positions
from touchstone.scenarios.scenario import vector

COVERED = [name for name, scenario in catalogue().items() if final_positions(scenario) is not None]


def moved(scenario, name, shift):
    bodies = tuple(
        replace(body, position=vector(np.array(body.position) + shift)) if body.name == name else body
        for body in scenario.bodies
    )
    return replace(scenario, bodies=bodies, truths=(), expectations=())


def test_what_is_covered():
    """Cover free flight, bounces and collisions of two balls, and nothing that rolls, slides or is driven."""
    families = {name.partition("_")[0] for name in COVERED}
    assert families >= {"fall", "bounce", "collide"}
    assert families.isdisjoint({"ball", "cradle", "slide", "slip", "roll", "spring", "stack", "incline"})


@pytest.mark.parametrize("name", COVERED)
def test_ends_are_those_of_the_truth(name):
    """End where the scene's truth ends."""
    scenario = catalogue()[name]
    ends = final_positions(scenario)
    for k, truth in enumerate(scenario.truths):
        must_be = motion(scenario, truth, np.array([0.0, scenario.duration])).position[-1]
        # truths count bounces until 1e-6 m/s; two ways to add the same times
        np.testing.assert_allclose(ends[k], must_be, atol=1e-12)


def test_a_ball_that_misses_flies_on():
    """Let balls pass each other that are farther off than their diameters."""
    scenario = moved(catalogue()["collide_oblique"], "mover", (0.0, 0.1, 0.0))
    ends, mover = final_positions(scenario), scenario.bodies[0]
    way = np.array(mover.linear_velocity) * scenario.duration
    np.testing.assert_allclose(ends, [mover.position + way, scenario.bodies[1].position], atol=1e-15)


def test_a_head_on_hit_forgets_how_far_it_came():
    """Stop a ball that meets its equal head on with e = 1 where it always stops; send the other off later."""
    scenario = replace(catalogue()["collide_ratio_1e3"], truths=())
    bodies = (replace(scenario.bodies[0], mass=1.0), scenario.bodies[1])
    scenario = replace(scenario, bodies=bodies)
    shift = np.array([-1e-3, 0.0, 0.0])
    change = final_positions(moved(scenario, "mover", shift)) - final_positions(scenario)
    # the mover stops a diameter before the target's place; the target starts later, by 1e-3 m of its way
    np.testing.assert_allclose(change, [np.zeros(3), shift], atol=1e-15)
