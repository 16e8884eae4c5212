"""One call that plays a scene on several engines."""

import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from touchstone.adapters.contract import AdapterError
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import Entry
from touchstone.adapters.workers.children import Children
from touchstone.adapters.workers.play import play
from touchstone.scenarios.effects import PLANNED

FAKES = ("healthy", "speeds", "throws", "exits", "unsupported")


@pytest.fixture
def fakes(monkeypatch, tmp_path, forked):
    """The fake engines in the registry's place, and children that load them."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    from fake_engines import load

    entries = {name: Entry("fake_engines:Engine", "numpy", {"only": 1 / 60}) for name in FAKES}
    entries["missing"] = Entry("nowhere:Engine", "no_such_package", {"only": 1 / 60})
    monkeypatch.setattr("touchstone.adapters.registry.ENGINES", entries)
    with Children(partial(load, str(tmp_path))) as children:
        yield children
    sys.modules.pop("fake_engines", None)


def test_every_engine_has_its_entry(lab, fakes):
    """Give a run per engine: whole, until it failed, or none, with status and reason; leave no files."""
    scenario = lab.scene(lab.ball(), lab.ground(), duration=1.0)
    runs = play(scenario, (*FAKES, "missing"), effects=PLANNED, children=fakes)
    assert list(runs) == [(name, "only") for name in (*FAKES, "missing")]
    reported = {name: (run.status, run.reason) for (name, _), run in runs.items()}
    assert reported == {
        "healthy": ("done", ""),
        "speeds": ("error", "diverged: the linear velocity of 'ball' is 1e+30 m/s, in frame 40 at 0.6667 s"),
        "throws": ("error", "ZeroDivisionError: one"),
        "exits": ("error", "died during 'play': exit code 7"),
        "unsupported": ("skipped", "unsupported: no spheres"),
        "missing": ("missing", "not installed (no module 'no_such_package')"),
    }
    frames = {name: len(run.recording.time) for (name, _), run in runs.items() if run.recording}
    assert frames == {"healthy": 61, "speeds": 40, "throws": 40}
    assert runs["speeds", "only"].recording.ended == reported["speeds"][1]
    assert runs["healthy", "only"].recording.ended == ""


def test_unknown_names_are_refused(lab):
    """Refuse engines and profiles that do not exist with those that do, before anything is played."""
    scenario = lab.scene(lab.ball())
    with pytest.raises(
        AdapterError,
        match=r"unknown engine 'bulet'; did you mean 'bullet'",
    ):
        play(scenario, ("bulet",))
    with pytest.raises(AdapterError, match=r"reference: no profile 'maximal'; valid: balanced, paper"):
        play(scenario, (("reference", "maximal"),))


@pytest.mark.slow
def test_the_reference_plays_as_in_this_process(lab, registry):
    """Play two profiles of the reference and find what `record` finds, to the bit."""
    scenario = lab.scene(lab.ball(), lab.ground(), e=0.5, duration=0.5)
    runs = play(scenario, ("reference", ("reference", "accurate")))
    assert list(runs) == [("reference", "balanced"), ("reference", "accurate")]
    for profile in ("balanced", "accurate"):
        settings = registry.settings("reference", profile)
        here = record(registry.engine("reference"), scenario, settings)
        np.testing.assert_array_equal(runs["reference", profile].recording.position, here.position)
