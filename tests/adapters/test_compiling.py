"""Compilation of the reference: what it says of its progress."""

import os
from contextlib import nullcontext

import pytest

from touchstone.adapters.engines.reference import compile_progress as progress
from touchstone.adapters.engines.reference import compiling
from touchstone.reference_impl.core import kernel_cache
from touchstone.reference_impl.core.kernel import KERNELS


@pytest.mark.parametrize(
    ("share", "elapsed", "usual", "left"),
    [(0.0, 0.0, 60.0, 60), (0.05, 20.0, 60.0, 40), (0.5, 30.0, 60.0, 30), (0.5, 90, 60, 90), (1, 9, 9, 5)],
)
def test_time_left(share, elapsed, usual, left):
    """The usual time counts at first, then the compilation's own pace."""
    assert progress.time_left(share, elapsed, usual) == left


def test_progress_counts_kernels_while_one_compiles(tmp_path, monkeypatch):
    """Say how many kernels are done between the start and the end of a compilation, and nothing otherwise."""
    folder = tmp_path / "new"
    monkeypatch.setattr(progress, "CACHE_FOLDER", folder)
    folder.mkdir()
    assert progress.compile_progress() == ""
    (folder / progress.LOCK).touch()
    for k in range(3):
        (folder / f"module.{k}.digest.kernel.nbc").touch()
        (folder / f"module.{k}.digest.python.nbc").touch()
    assert progress.compile_progress().startswith("compiling the reference, once per version of it: 3 of ")
    (folder / progress.NOTE).write_text("1.0")
    assert progress.compile_progress() == ""


def test_the_last_version_tells_the_usual_time(tmp_path):
    """Take the time of the version that this machine compiled last; without one, a constant."""
    assert progress.usual_seconds(tmp_path) == progress.USUAL_SECONDS
    for k, seconds in enumerate(("30", "20")):
        (tmp_path / str(k)).mkdir()
        note = tmp_path / str(k) / progress.NOTE
        note.write_text(seconds)
        os.utime(note, (1000 + k, 1000 + k))
    assert progress.usual_seconds(tmp_path) == 20


def test_a_damaged_note_tells_no_usual_time(tmp_path):
    """Skip notes that make no sense."""
    for text in ("", "garbage", "nan"):
        (tmp_path / f"folder {text}").mkdir()
        (tmp_path / f"folder {text}" / progress.NOTE).write_text(text)
    assert progress.usual_seconds(tmp_path) == progress.USUAL_SECONDS


@pytest.fixture
def quick(tmp_path, monkeypatch):
    """`compile_seconds` in an empty cache folder, with a compilation of 1.5 s that takes no time."""
    unwritten: list[str] = []
    monkeypatch.setattr(compiling, "CACHE_FOLDER", tmp_path)
    monkeypatch.setattr(compiling, "_compiled", lambda: 1.5)
    monkeypatch.setattr(compiling, "_helper", nullcontext)
    for module in (compiling, kernel_cache):
        monkeypatch.setattr(module, "UNWRITTEN", unwritten)
    return compiling.compile_seconds.__wrapped__


def test_a_damaged_note_is_written_again(quick, tmp_path):
    """Compile what the cache lacks, and note the time, where the note is empty."""
    (tmp_path / progress.NOTE).touch()
    assert quick() == 1.5
    assert (tmp_path / progress.NOTE).read_text() == "1.50"


def test_a_cache_that_takes_no_files_ends_nothing(quick, tmp_path, capsys):
    """Compile without a lock and without a note where the folder takes neither, and say so."""
    (tmp_path / progress.LOCK).mkdir()  # unwritable for root too
    (tmp_path / progress.NOTE).mkdir()
    assert quick() == 1.5
    assert "Is a directory; kernels compile in every process" in capsys.readouterr().err
    (tmp_path / progress.NOTE).rmdir()
    assert quick() == 1.5
    assert not (tmp_path / progress.NOTE).exists()  # a kernel is missing in the folder


def test_a_compilation_in_every_process_is_announced(monkeypatch):
    """Say at the start, and while an engine does not answer, that no folder keeps the kernels."""
    monkeypatch.setattr(progress, "CACHE_FOLDER", None)
    assert progress.announcement() == progress.compile_progress() == progress.UNCACHED


def test_the_second_process_compiles_what_the_first_calls():
    """The simulated loop's kernels have one signature after both processes' parts are compiled."""
    compiling.compile_seconds()
    compiling._compiled()
    compiling.compile_simulated_loop(os.getppid())
    names = ["solve_resting_contacts", "resolve_impacts", "guard_energy", "gather_contacts"]
    names += ["separate_simulated", "earliest_impact", "update_fat_bounds", "is_isolated"]
    names += ["set_ways", "end_substep", "first_return"]
    found = [one for one in KERNELS if one.py_func.__name__ in names and one.signatures]
    assert {one.py_func.__name__ for one in found} == set(names)
    assert [one.signatures for one in found if len(one.signatures) > 1] == []
