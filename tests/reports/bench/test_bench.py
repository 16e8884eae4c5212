"""`touchstone bench`: each is whole, leaves a whole folder or none, and ends with a code that means it."""

import sys
from math import nan
from pathlib import Path

import pytest

from touchstone.reports.bench import BENCHES, load, scaling
from touchstone.reports.bench.scaling import BROAD_PHASE
from touchstone.reports.cli import main as cli
from touchstone.reports.output_folder import OutputError
from touchstone.reports.progress import quietly
from touchstone.reports.results import Row, table
from touchstone.reports.verdict import limits
from touchstone.reports.verdict.judge import judged
from touchstone.reports.verdict.limits import Limit


@pytest.mark.parametrize("name", BENCHES)
def test_a_full_folder_is_refused(name: str, tmp_path: Path) -> None:
    """Keep what is there, before anything is measured."""
    (tmp_path / "mine").touch()
    with pytest.raises(OutputError, match="not an empty folder"):
        load(name).run(tmp_path, quietly)
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


@pytest.mark.parametrize("name", BENCHES)
def test_an_interrupted_bench_leaves_nothing(name: str, tmp_path: Path) -> None:
    """Leave no folder, nor part of one, when Ctrl-C comes with the first progress."""

    def interrupt(label: str, count: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        load(name).run(tmp_path / "out", interrupt)
    assert list(tmp_path.iterdir()) == []


def test_a_broken_limit_fails_the_command(monkeypatch, tmp_path: Path, capfd) -> None:
    """End with exit 1 and the reason where a limit is broken, 0 where it holds."""

    row = Row("bench scaling", BROAD_PHASE, "reference", "balanced", nan, "scaling.exponent", 1.0, "1")
    for largest, wanted in ((0.9, 1), (1.1, 0)):
        monkeypatch.setattr(limits, "LIMITS", (Limit("scaling.exponent", largest, "as asked"),))
        monkeypatch.setattr(scaling, "run", lambda out, progress: table([judged(row, ())]))
        monkeypatch.setattr(sys, "argv", ["touchstone", "bench", "scaling", "--out", str(tmp_path / "o")])
        with pytest.raises(SystemExit) as end:
            cli.main()
        out, _ = capfd.readouterr()
        assert (end.value.code or 0) == wanted
        assert ("limit 0.900: as asked" in out) == (wanted == 1)
