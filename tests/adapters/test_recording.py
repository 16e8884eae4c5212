"""Recordings on disk: whole or absent, the same to the bit, and never anything but a recording."""

import errno
import json
from dataclasses import fields, replace

import numpy as np
import pytest
from forged_recordings import WAYS, forge

from touchstone.adapters import recording as module
from touchstone.adapters.recording import FORMAT_VERSION, Recording, RecordingError, load

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
    registry.played("ball_snip", "reference").save(path)
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
