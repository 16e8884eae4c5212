"""The cache of recordings: what it keeps, what it removes, and what damages it."""

from __future__ import annotations

import os

import numpy as np
import pytest

from touchstone.reports.assertions.player import PlayCache


@pytest.fixture
def recording(registry, tmp_path):
    """A recording and its file."""
    (tmp_path / "run").mkdir()
    path = tmp_path / "run" / "run.npz"
    run = registry.played("fall", "reference")
    run.save(path)
    return run, path


@pytest.fixture
def folder(tmp_path):
    """An empty folder of a cache."""
    home = tmp_path / "cache"
    home.mkdir()
    return home


def test_what_was_put_comes_back(recording, folder):
    """A recording is equal to the bit, a refusal keeps its reason, failures are not kept."""
    run, path = recording
    cache = PlayCache(folder)
    cache.put("a", "done", "", path)
    cache.put("b", "skipped", "toy: no boxes", path)
    cache.put("c", "error", "it crashed", path)
    status, _, kept = cache.get("a")
    assert status == "done"
    assert np.array_equal(kept.position, run.position)
    assert cache.get("b") == ("skipped", "toy: no boxes", None)
    assert cache.get("c") is None
    assert sorted(path.name for path in folder.iterdir()) == ["a.npz", "b.txt"]


def test_a_damaged_recording_is_played_again(recording, folder):
    """It is removed, not raised."""
    cache = PlayCache(folder)
    cache.put("a", "done", "", recording[1])
    (folder / "a.npz").write_bytes(recording[1].read_bytes()[:500])
    assert cache.get("a") is None
    assert list(folder.iterdir()) == []


def test_what_is_used_is_kept_longest(recording, folder):
    """Beyond its size the cache loses what was not used for the longest time."""
    cache = PlayCache(folder)
    for age, key in enumerate("abc"):
        cache.put(key, "done", "", recording[1])
        os.utime(folder / f"{key}.npz", (age, age))
    cache.get("a")
    cache.trim(2 * recording[1].stat().st_size)
    assert sorted(path.stem for path in folder.iterdir()) == ["a", "c"]


def test_a_folder_that_cannot_be_written_keeps_nothing(recording, folder):
    """A cache whose folder is gone neither raises nor keeps."""
    cache = PlayCache(folder)
    folder.rmdir()
    cache.put("a", "done", "", recording[1])
    assert cache.get("a") is None
    assert not folder.exists()


def test_without_a_folder_nothing_is_kept(recording):
    """The cache of a session without pytest's cache is empty and stays so."""
    cache = PlayCache()
    cache.put("a", "done", "", recording[1])
    assert cache.get("a") is None
