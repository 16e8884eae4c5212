"""Imports tried in children: what happened, whatever happened."""

import sys
from functools import partial
from pathlib import Path

import pytest

from touchstone.adapters import registry
from touchstone.adapters.registry import Entry, missing_reason
from touchstone.adapters.workers.import_check import Imported, try_imports

FATES = {
    "healthy": Imported("done", "1.2.3"),
    "cannot be imported": Imported("unimportable", "cannot be imported: libfake.so.3: no such file"),
    "throws on load": Imported("error", "RuntimeError: no such"),
    "dies on load": Imported("error", "died during 'import': signal SIGSEGV"),
}


@pytest.fixture
def fakes(tmp_path, monkeypatch, forked):
    """The loader of the fake engines, which children can import too."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    from fake_engines import load

    yield partial(load, str(tmp_path))
    sys.modules.pop("fake_engines", None)


def test_each_import_ends_in_its_own_way(fakes):
    """An import that raises or crashes is one answer, in the order asked for, and stops no other."""
    assert list(try_imports(tuple(FATES), fakes).items()) == list(FATES.items())


def test_an_import_that_hangs_is_given_up(fakes):
    """What does not answer is an error after the patience given."""
    found = try_imports(("hangs on load",), fakes, patience=1.0)
    assert found["hangs on load"] == Imported("error", "hung: no answer to 'import' for 1 s")


def test_what_is_not_installed_starts_no_process(monkeypatch):
    """An engine without its package is missing, with the way to get it."""
    entry = Entry("touchstone.adapters.no_engine:None", "no_such_package", {"recommended": 1 / 60})
    monkeypatch.setitem(registry.ENGINES, "absent", entry)
    assert try_imports(("absent",)) == {"absent": Imported("missing", missing_reason("absent"))}
