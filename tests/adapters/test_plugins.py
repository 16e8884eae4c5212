"""Engines of others: found, examined in a child process, played, and refused in one line where faulty."""

import sys
import tomllib
from pathlib import Path

import pytest

from touchstone.adapters.contract import AdapterError, Settings
from touchstone.adapters.engines import plugin
from touchstone.adapters.engines.entry import ENGINES, GROUP, Entry
from touchstone.adapters.engines.simple_world import SimpleWorld
from touchstone.adapters.registry import OURS, available, load, missing_reason, registered
from touchstone.adapters.workers.children import Children
from touchstone.adapters.workers.play import play

ROOT = Path(__file__).parents[2]
TOY = (ROOT / "docs" / "toy_engine.py").read_text()
SOUND = """
class Engine:
    name, profiles = "sound", {"default": 1 / 240}
    def build(self, scenario, settings): ...
    def version(self): return "1"
"""


@pytest.fixture
def package(monkeypatch, tmp_path):
    """Write modules into a folder on the path; what they register is forgotten afterwards."""
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    before, modules = dict(ENGINES), set(sys.modules)

    def write(**modules: str) -> Path:
        for name, text in modules.items():
            (tmp_path / f"{name}.py").write_text(text)
        return tmp_path

    yield write
    ENGINES.clear()
    ENGINES.update(before)
    for name in set(sys.modules) - modules:
        if getattr(sys.modules[name], "__file__", None) and str(tmp_path) in str(sys.modules[name].__file__):
            del sys.modules[name]


def test_ours_are_declared_like_those_of_others():
    """`pyproject.toml` declares our engines in the group of entry points, as the registry lists them."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["entry-points"][GROUP] == OURS


def test_an_engine_that_is_not_installed_plays(package, lab):
    """`module:Class` is enough: child processes load the engine too, under the name that it states."""
    package(toy_plugin=TOY)
    scenario = lab.scene(lab.ground(), lab.ball(position=(0.0, 0.0, 0.3)), e=0.5, duration=0.5)
    runs = play(scenario, ["toy_plugin:ToyEngine"])
    run = runs["toy", "default"]
    assert (run.status, run.reason) == ("done", "")
    assert run.recording.facts["engine"] == "toy"
    assert run.recording.position[-1, 1, 2] < 0.3
    assert len(run.recording.contacts)


def test_children_know_an_engine_registered_at_run_time(monkeypatch, package, lab):
    """A child process has the registry of its parent, as it is when the child starts."""
    package(toy_plugin=TOY)
    monkeypatch.setitem(ENGINES, "late", Entry("toy_plugin:ToyEngine", "toy_plugin", {"default": 1 / 240}))
    with Children() as children:
        scenario = lab.scene(lab.ground(), lab.ball(), duration=0.1)
        assert play(scenario, ["late"], children=children)["late", "default"].status == "done"


def test_an_installed_package_is_found_by_its_entry_point(monkeypatch, package, lab):
    """An engine of the group is known by the name of its entry point."""
    folder = package(toy_plugin=TOY)
    info = folder / "toy_plugin-2.5.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toy-plugin\nVersion: 2.5\n")
    (info / "entry_points.txt").write_text(f"[{GROUP}]\ntoys = toy_plugin:ToyEngine\nlost = gone:Engine\n")
    monkeypatch.setattr(plugin, "declared", plugin.declared.__wrapped__)
    monkeypatch.setattr("touchstone.adapters.registry.declared", plugin.declared)
    assert {"toys", "lost"} <= set(available())
    assert registered("toys") == "toys"
    assert ENGINES["toys"].distribution == "toy-plugin"
    assert load("toys").version() == "1.0"
    with pytest.raises(AdapterError, match=r"^engine 'gone:Engine': no module 'gone' on the path or in "):
        registered("lost")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = 1 / 0", r"its import fails: ZeroDivisionError: division by zero \(.*faulty.py, line 1\)"),
        ("x = (", r"its import fails: SyntaxError: .*faulty.py, line 1"),
        ("import nowhere_at_all", r"its import fails: No module named 'nowhere_at_all' \(.*, line 1\)"),
        ("class Engin: pass", r"module 'faulty' has no 'Engine'; did you mean 'Engin'\?"),
        ("class Engine: pass", r"it is no engine: it has no build and no version and no name"),
        (SOUND.replace('"sound"', '"a/b"'), r"its name is 'a/b'; expected letters"),
        (SOUND.replace('{"default": 1 / 240}', "{}"), r"its profiles are \{\}; expected"),
        (SOUND.replace("1 / 240", "-1"), r"its profile 'default' has the step -1; expected seconds"),
        (SOUND.replace("1 / 240", "float('nan')"), r"its profile 'default' has the step nan; expected"),
    ],
)
def test_a_faulty_plugin_is_refused_with_its_fault(package, text, said):
    """A plug-in that cannot be loaded, or is no engine, is named with the fault and its place."""
    package(faulty=text)
    with pytest.raises(AdapterError, match=said):
        plugin.examined("faulty:Engine")


@pytest.mark.parametrize(
    ("text", "patience", "said"),
    [
        ("import os; os._exit(7)", 60.0, "died during 'examine': exit code 7"),
        ("import time; time.sleep(600)", 2.0, "hung: no answer to 'examine' for 2 s"),
    ],
)
def test_an_import_that_ends_or_hangs_ends_nothing_else(monkeypatch, package, text, patience, said):
    """The import of a plug-in happens in a child process with a time limit."""
    package(faulty=text)
    monkeypatch.setattr(plugin, "PATIENCE", patience)
    with pytest.raises(AdapterError, match=f"^engine 'faulty:Engine': {said}$"):
        registered("faulty:Engine")


@pytest.mark.parametrize("target", ["x:", ":x", "a b:C", "a:b:c", "../a:C"])
def test_a_target_has_two_parts(target):
    """What is not module:Class is refused before anything is imported."""
    with pytest.raises(AdapterError, match=r"expected module:Class, such as mypkg\.adapter:MyEngine"):
        registered(target)


def test_no_plugin_replaces_an_engine_of_ours(package):
    """A plug-in that calls itself like one of ours is refused."""
    package(faulty=SOUND.replace("sound", "mujoco"))
    with pytest.raises(
        AdapterError, match="its `name` is 'mujoco', another engine's; give it one of its own"
    ):
        registered("faulty:Engine")


def test_two_versions_of_an_engine_need_two_names(package):
    """The error of the second names the first."""
    package(first=SOUND, second=SOUND)
    registered("first:Engine")
    with pytest.raises(
        AdapterError, match="its `name` is 'sound', that of first:Engine; give it one of its own"
    ):
        registered("second:Engine")


def test_a_module_that_went_away_is_named(monkeypatch):
    """The reason why an engine of others is missing names its module, not an extra of ours."""
    monkeypatch.setitem(ENGINES, "gone", Entry("gone_away:Engine", "gone_away", {"default": 1 / 240}))
    assert missing_reason("gone") == "not installed (no module 'gone_away')"


def test_a_world_that_cannot_step_is_named(lab) -> None:
    """A world made from `SimpleWorld` without a step of its own is named in one line."""

    class Still(SimpleWorld):
        engine, version = "still", "1"

    world = Still(lab.scene(lab.ball()), Settings("default", 1 / 240))
    with pytest.raises(AdapterError, match=r"^still: Still defines no step\(self\)$"):
        world.step()
