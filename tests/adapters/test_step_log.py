"""Blocks of steps give what each step alone gives."""

import numpy as np
import pytest

from touchstone.adapters import step_log
from touchstone.adapters.contract import State
from touchstone.adapters.vector_products import cross, turned
from touchstone.scenarios.catalogue import catalogue

SCENE, DT, STEPS = "push_box", 1 / 240, 23


def states(scenario, rng):
    """A start and STEPS random states with contacts, some with times and velocities of their own."""
    for step in range(STEPS + 1):
        state = State(scenario)
        state.values[:] = rng.normal(size=len(state.values))
        state.applied[:] = rng.normal(size=len(state.applied))
        for _ in range(step % 4):
            a, b = rng.choice(len(scenario.bodies), 2, replace=False).tolist()
            state.add_contact(a, b, rng.normal(size=3), rng.normal(size=3), -0.1, rng.normal(size=3))
            if rng.random() < 0.5:
                row = state.contacts[state.contact_count - 1]
                row["time"], row["velocity_a_before"] = 1e-3, rng.normal(size=3)
        yield state


def centers(scenario, state, body):
    """Centres of mass of bodies (c, 3) [m]."""
    own = np.array([scenario.bodies[k].center_of_mass for k in body]).reshape(-1, 3)
    return state.position[body] + turned(state.orientation[body], own)


def contacts_of_step(scenario, time, before, after):
    """The rows of one step."""
    rows = after.contacts[: after.contact_count].copy()
    rows["time"] = np.where(np.isnan(rows["time"]), time, time + rows["time"])
    for side in "ab":
        body = rows[f"body_{side}"]
        arm = rows["position"] - centers(scenario, before, body)
        for moment, state in (("before", before), ("after", after)):
            own = state.linear_velocity[body] + cross(state.angular_velocity[body], arm)
            column = rows[f"velocity_{side}_{moment}"]
            column[:] = np.where(np.isnan(column), own, column)
    return rows


def work_of_step(scenario, before, after):
    """Work of the drives [J]."""
    work = 0.0
    for k, tracker in enumerate(scenario.trackers):
        root = np.array([scenario.body_index(tracker.root)])
        both = [
            s.linear_velocity[root]
            + cross(s.angular_velocity[root], s.position[root] - centers(scenario, s, root))
            for s in (before, after)
        ]
        turning = (before.angular_velocity[root[0]] + after.angular_velocity[root[0]]) / 2
        work += float(after.force[k] @ (both[0] + both[1])[0] / 2 + after.torque[k] @ turning)
    return (work + float(after.hinge_torque @ (before.joint_rate + after.joint_rate) / 2)) * DT


@pytest.mark.parametrize(("steps", "rows"), [(64, 4096), (3, 4096), (64, 2), (1, 1)])
def test_blocks_change_nothing(monkeypatch, steps, rows):
    """Contacts, work and impulses are those of single steps to the bit, whatever the size of a block."""
    monkeypatch.setattr(step_log, "STEPS", steps)
    monkeypatch.setattr(step_log, "ROWS", rows)
    scenario = catalogue()[SCENE]
    start, *after = states(scenario, np.random.default_rng(15))
    log = step_log.StepLog(scenario, DT, start)
    log.mark()
    found, work, impulse = [], [0.0], [np.zeros((len(scenario.trackers), 3))]
    for k, state in enumerate(after):
        log.add(k * DT, state)
        found.append(contacts_of_step(scenario, k * DT, ([start, *after])[k], state))
        work.append(work[-1] + work_of_step(scenario, ([start, *after])[k], state))
        impulse.append(impulse[-1] + state.force * DT)
        if (k + 1) % 4 == 0:
            log.mark()
    whole = STEPS - STEPS % 4
    assert log.contacts().tobytes() == np.concatenate(found[:whole]).tobytes()
    works, impulses = log.drive()
    assert works.tolist() == work[: whole + 1 : 4]
    assert np.array_equal(impulses, impulse[: whole + 1 : 4])


def test_work_of_posed_bodies_is_unknown():
    """Without forces of the drive there is no work, and contacts keep their rows."""
    scenario = catalogue()[SCENE]
    start, *after = states(scenario, np.random.default_rng(16))
    log = step_log.StepLog(scenario, DT, start)
    for k, state in enumerate(after):
        state.applied[:] = np.nan
        log.add(k * DT, state)
    log.mark()
    work, impulse = log.drive()
    assert np.isnan(work).all()
    assert np.isnan(impulse).all()
    assert len(log.contacts()) == sum(state.contact_count for state in after)
