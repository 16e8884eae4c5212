"""Physical laws asserted on an engine of one's own; run it with pytest in the folder of toy_engine.py."""

import pytest

import touchstone as ts


@pytest.mark.engine("toy_engine:ToyEngine")
@pytest.mark.scenario("bounce_e05", "slip", "collide_sticks")
def test_laws(play, scenario, engine):
    run = play(scenario, engine)
    ts.assert_no_tunnelling(run)
    ts.assert_energy_not_created(run)
    ts.assert_friction_cone(run)
