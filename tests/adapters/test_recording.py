"""Recordings on disk: whole or absent, the same to the bit; blocks of steps give what each step gives."""

import errno
import json
from dataclasses import fields, replace

import numpy as np
import pytest
from forged_recordings import WAYS, forge

from touchstone.adapters import recording as module
from touchstone.adapters import step_log
from touchstone.adapters.contract import State
from touchstone.adapters.recording import FORMAT_VERSION, Recording, RecordingError, load
from touchstone.adapters.vector_products import cross, turned
from touchstone.scenarios.catalogue import catalogue

SIGNATURE_AND_SIZES = 60
"""Bytes at the start of an archive whose damage is worth a try each."""


@pytest.fixture(scope="module")
def kept(lab, recordings):
    """A small recording without two equal numbers, with awkward ones among them."""
    scenario = lab.scene(lab.ball(), lab.ground(), duration=0.1)
    blank = recordings.recording(scenario)
    rng = np.random.default_rng(1)
    columns = {}
    for field in fields(Recording):
        value = getattr(blank, field.name)
        if isinstance(value, np.ndarray) and value.dtype == float and field.name != "time":
            columns[field.name] = rng.random(size=value.shape)
    columns["stage_seconds"] = rng.normal(size=(6, 2))
    columns["driver_work"] = np.array([np.nan, -1e308, -0.0, 5e-324, 1 / 3, 1e308, 0.1])
    rows = recordings.contacts(
        {"body_a": 0, "body_b": 1, "impulse": rng.normal(size=3), "time": 5e-324}, {"distance": -1e-9}
    )
    names = np.array(["collision", "\u00fc"])
    return replace(blank, contacts=rows, stage_names=names, **columns)


@pytest.fixture
def saved(kept, tmp_path):
    """The same, on disk."""
    kept.save(tmp_path / "run.npz")
    return tmp_path / "run.npz"


def test_round_trip_keeps_every_bit(kept, saved):
    """Every array comes back with its type, shape and bits, every text as it was."""
    back = load(saved)
    for field in fields(Recording):
        ours, theirs = getattr(kept, field.name), getattr(back, field.name)
        if isinstance(ours, str):
            assert (ours, type(theirs)) == (theirs, str)
        else:
            assert (ours.dtype, ours.shape, ours.tobytes()) == (theirs.dtype, theirs.shape, theirs.tobytes())
    assert json.loads(back.scenario)["bodies"][0]["name"] == "ball"
    assert back.facts["engine"] == "test"
    assert [path.name for path in saved.parent.iterdir()] == ["run.npz"]


def rewritten(path, **changes):
    """The archive with fields changed, or dropped where they are None."""
    with np.load(path) as archive:
        columns = {name: archive[name] for name in archive.files} | changes
    np.savez_compressed(path, **{name: value for name, value in columns.items() if value is not None})


@pytest.mark.parametrize("version", [FORMAT_VERSION + 1, 0, None])
def test_another_format_version_is_refused(saved, version):
    """A file of another version, or of none, is refused with both versions in one line."""
    rewritten(saved, format_version=None if version is None else np.array(version))
    with pytest.raises(RecordingError, match=rf"run.npz: format version .*reads {FORMAT_VERSION}$"):
        load(saved)


@pytest.mark.parametrize("change", [{"contacts": None}, {"surprise": np.zeros(2)}])
def test_a_missing_or_unknown_field_is_named(saved, change):
    """A file that lacks a field, or has one too many, is refused by the field's name."""
    rewritten(saved, **change)
    with pytest.raises(RecordingError, match=f"run.npz: fields .*{next(iter(change))}"):
        load(saved)


@pytest.mark.parametrize("way", WAYS)
def test_a_forged_recording_is_refused_by_its_field(registry, tmp_path, way):
    """Types, shapes, texts and sizes that no run writes end in one line that names file and field."""
    path = tmp_path / "run.npz"
    path.write_bytes(registry.saved("ball_snip", "reference"))
    named = forge(path, way)
    with pytest.raises(RecordingError) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_flipped_byte_is_noticed_or_harmless(kept, saved):
    """Damage anywhere ends in a RecordingError or in the same recording, never in another error or value."""
    whole = saved.read_bytes()
    places = np.random.default_rng(2).integers(len(whole), size=150)
    refused = 0
    for place in (*range(SIGNATURE_AND_SIZES), *places):
        saved.write_bytes(whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :])
        try:
            back = load(saved)
        except RecordingError:
            refused += 1
        else:
            assert back.position.tobytes() == kept.position.tobytes()
    assert refused > 100


def test_pickled_objects_are_refused(saved):
    """A file that would run code on loading is refused."""
    rewritten(saved, position=np.array([{"a": 1}], dtype=object))
    with pytest.raises(RecordingError, match=r"run\.npz.*allow_pickle"):
        load(saved)


def test_a_full_disk_leaves_the_old_file_and_nothing_else(kept, saved, monkeypatch):
    """When writing fails half-way the file that was there stays whole and no part of the new one is left."""
    before = saved.read_bytes()

    def full(file, **columns):
        file.write(b"half")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(module.np, "savez_compressed", full)
    with pytest.raises(OSError, match="No space left"):
        kept.save(saved)
    assert saved.read_bytes() == before
    with pytest.raises(OSError, match="No space left"):
        kept.save(saved.with_name("new.npz"))
    assert [path.name for path in saved.parent.iterdir()] == ["run.npz"]


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
