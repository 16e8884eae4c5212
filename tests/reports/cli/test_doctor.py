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


def test_damaged_files_are_counted_and_removed(cache):
    """Say how many files are damaged, and that the next run compiles their kernels."""
    for k, size in enumerate((0, 100)):
        (cache / f"{k}.nbc").write_bytes(os.urandom(size))
    told = f"{cache}; damaged files removed: 2, the next run compiles their kernels again"
    assert compile_facts()["kernel cache"] == told
    assert [path.name for path in cache.iterdir()] == ["good.nbc"]


FULL = "/full/kernels: 0 MB free, 100 MB needed"


@pytest.mark.parametrize(
    ("rejected", "unwritten", "told"),
    [
        ([], [], ""),
        ([FULL], [], f"; not used: {FULL}"),
        ([], ["a.nbc"], "; 1 kernels could not be written, they compile in every process"),
    ],
)
def test_a_folder_is_named_with_what_is_wrong(cache, rejected, unwritten, told):
    """Name the folder, one that was not used with its reason, and how many files were not written."""
    kernel_cache.REJECTED.extend(rejected)
    kernel_cache.UNWRITTEN.extend(unwritten)
    assert compile_facts()["kernel cache"] == f"{cache}{told}"


def test_without_a_folder_kernels_compile_in_every_process(monkeypatch):
    """Say so, and why no folder was used."""
    kernel_cache.REJECTED.append(FULL)
    monkeypatch.setattr(kernel_cache, "CACHE_FOLDER", None)
    assert compile_facts()["kernel cache"] == f"none, kernels compile in every process; not used: {FULL}"
