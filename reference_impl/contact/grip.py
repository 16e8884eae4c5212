"""Static friction: whether a contact grips, and bears its static coefficient, or slides with the lesser one.

A contact that stuck at the end of a substep grips at the start of the next; so does one without slip. It
keeps its grip as long as the impulses that hold it stay within the static cone. Where they do not, it slides
from the start of the substep, which ends before, at the onset (`contact_events.first_onset`), if the force
grew to the cone within it. What slides grips again where its slip ends: at an event (`first_stop`), after
which it turns back, or holds, within the first instant of the next substep.
"""

from math import sqrt

from touchstone.reference_impl.contact.contact_events import (
    CONE_CLOSE,
    SLIDE_MIN,
    SLIP_MIN,
    along_slip,
    before_across,
)
from touchstone.reference_impl.core.conventions import GRIP_NONE, GRIPS, RELEASED, SLIDES
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import dot
from touchstone.reference_impl.solver.mobility import final_velocity


@kernel
def forget_grips(pairs, count):
    """Leave the grips of the rows `pairs[:count]` to be found at the start of the substep."""
    for k in range(count):
        pairs[k]["grip"] = GRIP_NONE


@kernel
def find_grip(pair):
    """Decide whether a row grips at the start of a substep, if that is not known, and set its coefficient."""
    if pair["static"] == 0:
        return
    if pair["grip"] == GRIP_NONE:
        x, y, z = before_across(pair)
        slip = sqrt(x * x + y * y + z * z)
        pair["grip"] = GRIPS if slip <= (SLIDE_MIN if pair["stuck"] == 1 else SLIP_MIN) else SLIDES
    pair["friction"] = pair["static"] if pair["grip"] == GRIPS else pair["sliding_friction"]


@kernel
def release_grips(bodies, pairs, count, state):
    """Make the rows slide that leave their static cones; returns whether any does."""
    found = False
    for k in range(count):
        if pairs[k]["static"] > 0 and pairs[k]["grip"] == GRIPS and _slides(bodies, pairs[k], state):
            pairs[k]["grip"], found = RELEASED, True
    return found


@kernel
def regain_grips(bodies, pairs, count, state):
    """Let the rows grip whose slip has ended within the substep, and that slide on in another direction;
    returns whether any does."""
    found = False
    for k in range(count):
        pair = pairs[k]
        if pair["static"] > 0 and pair["grip"] == SLIDES and _slides(bodies, pair, state):
            x, y, z = before_across(pair)
            if along_slip(pair, state["velocity"]) <= SLIP_MIN * sqrt(x * x + y * y + z * z):
                pair["grip"], found = GRIPS, True
    return found


@kernel
def note_grips(bodies, pairs, count, state):
    """Store which rows stick at the end of a substep."""
    for k in range(count):
        pair = pairs[k]
        if pair["static"] > 0:
            loaded = dot(pair["normal"], pair["resting_impulse"]) > 0
            pair["stuck"] = 1 if loaded and not _slides(bodies, pair, state) else 0


@kernel
def _slides(bodies, pair, state):
    """Whether a row slides by its solution: it has slip, and friction at the limit of its cone."""
    n, p, v = pair["normal"], pair["resting_impulse"], state["velocity"]
    v_n, j = final_velocity(bodies, pair, state), dot(n, p)
    slip, limit = dot(v, v) - v_n * v_n, (pair["friction"] * j) ** 2
    return j > 0 and slip > SLIP_MIN * SLIP_MIN and dot(p, p) - j * j >= (1 - CONE_CLOSE) * limit
