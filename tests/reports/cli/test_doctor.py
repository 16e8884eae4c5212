"""What `touchstone doctor` says of the compile cache."""

import os

import pytest

from touchstone.adapters.engines.reference import compiling
from touchstone.reference_impl.core import kernel_cache
from touchstone.reports.cli.doctor import compile_facts


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """A cache folder without faults, whose kernels took 30 s."""
    monkeypatch.setattr(compiling, "compile_seconds", lambda: 30.0)
    monkeypatch.setattr(kernel_cache, "CACHE_FOLDER", tmp_path)
    monkeypatch.setattr(kernel_cache, "REJECTED", [])
    monkeypatch.setattr(kernel_cache, "UNWRITTEN", [])
    kernel_cache.write_entry(tmp_path / "good.nbc", b"code")
    return tmp_path


def test_a_good_cache_is_a_folder(cache):
    """Name the folder, and nothing else."""
    assert compile_facts()["kernel cache"] == str(cache)


def test_damaged_files_are_counted_and_removed(cache):
    """Say how many files are damaged, and that the next run compiles their kernels."""
    for k, size in enumerate((0, 100)):
        (cache / f"{k}.nbc").write_bytes(os.urandom(size))
    told = f"{cache}; damaged files removed: 2, the next run compiles their kernels again"
    assert compile_facts()["kernel cache"] == told
    assert [path.name for path in cache.iterdir()] == ["good.nbc"]


def test_a_full_disk_is_named(cache, monkeypatch):
    """Name the folder that was not used, with its reason, and what happens where none is."""
    full = "/full/kernels: 0 MB free, 100 MB needed"
    kernel_cache.REJECTED.append(full)
    assert compile_facts()["kernel cache"] == f"{cache}; not used: {full}"
    monkeypatch.setattr(kernel_cache, "CACHE_FOLDER", None)
    assert compile_facts()["kernel cache"] == f"none, kernels compile in every process; not used: {full}"


def test_files_that_were_not_written_are_told(cache):
    """Say that other processes compile what could not be written."""
    kernel_cache.UNWRITTEN.append("a.nbc")
    told = f"{cache}; 1 kernels could not be written, they compile in every process"
    assert compile_facts()["kernel cache"] == told
