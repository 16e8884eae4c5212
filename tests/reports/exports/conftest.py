"""The program called in an empty folder."""

from __future__ import annotations

import sys

import pytest

from touchstone.reports.cli import main as cli


@pytest.fixture
def touchstone(monkeypatch, capfd, tmp_path_factory):
    """Call the program in this process, in an empty folder: (exit code, stdout, stderr)."""
    monkeypatch.chdir(tmp_path_factory.mktemp("empty"))

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["touchstone", *map(str, arguments)])
        capfd.readouterr()
        with pytest.raises(SystemExit) as end:
            cli.main()
        return (end.value.code or 0, *capfd.readouterr())

    return call
