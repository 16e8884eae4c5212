"""A hinge that bends in the open."""

from touchstone.scenarios.materials import TABLE_1
from touchstone.scenarios.scenario import Body, Box, Joint, Piece, Scenario, Tracker
from touchstone.scenarios.solids import box_inertia


def swing() -> Scenario:
    """A finger of 0.1 kg on a palm of 10 kg that stays where it is, bent by 1 rad in 0.5 s in the open."""
    half, middle = (0.05, 0.01, 0.01), (0.05, 0.0, 0.0)
    palm = Body("palm", "driven", "wood", (), mass=10.0, inertia=box_inertia(10.0, (0.1, 0.1, 0.1)))
    inertia = box_inertia(0.1, half)
    piece = (Piece("link", Box(half), middle),)
    link = Body("link", "driven", "wood", piece, mass=0.1, center_of_mass=middle, inertia=inertia)
    hinge = Joint("hinge", "palm", "link", (0.1, 0.0, 0.0), (0.0, 1.0, 0.0))
    still = {"positions": ((0.0, 0.0, 1.0),) * 2, "orientations": ((1.0, 0.0, 0.0, 0.0),) * 2}
    tracker = Tracker("palm", ("hinge",), (0.0, 0.5), angles=((0.0,), (1.0,)), **still)
    return Scenario("swing", "a swing", (), (palm, link), 0.5, TABLE_1, joints=(hinge,), trackers=(tracker,))
