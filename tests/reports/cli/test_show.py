"""`touchstone list` and `touchstone show` in every format."""

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest

from touchstone.adapters import registry
from touchstone.adapters.motion_bounds import planned
from touchstone.adapters.recorder import planned_for, record
from touchstone.adapters.registry import ENGINES, OURS, available, load
from touchstone.adapters.workers.variants import Pace, Variant
from touchstone.reports.docs.listing import engine_rows, show_rows
from touchstone.reports.metrics import METRICS
from touchstone.reports.runner.tasks import own_settings
from touchstone.reports.studies import effects
from touchstone.reports.studies.effects import REFERENCE, TOGGLED, toggles
from touchstone.scenarios.catalogue import catalogue, tags
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.files.write import scene_data
from touchstone.scenarios.scenario import Tracker
from touchstone.scenarios.solids import ball


@pytest.mark.parametrize("form", ["table", "json", "csv"])
@pytest.mark.parametrize("what", ["scenarios", "tags", "engines", "metrics", "profiles"])
def test_lists_in_every_format(touchstone, monkeypatch, what, form):
    """Each list names all there is, parses in its format, and writes nothing else."""
    monkeypatch.setenv("COLUMNS", "120")
    code, out, err = touchstone(f"list {what} --format {form}")
    assert (code, err) == (0, "")
    wanted = {
        "scenarios": list(catalogue()),
        "tags": list(tags()),
        "engines": list(available()),
        "metrics": list(METRICS),
        "profiles": [profile for entry in ENGINES.values() for profile in entry.profiles],
    }[what]
    if form == "json":
        names = [next(iter(row.values())) for row in json.loads(out)]
    elif form == "csv":
        names = [row[0] for row in csv.reader(io.StringIO(out))][1:]
    else:
        # a cell that is wrapped goes on below, under its own column
        names = [line.split()[0] for line in out.splitlines() if not line.startswith(" ")][1:]
    assert names == wanted


@pytest.mark.parametrize("name", OURS)
def test_a_missing_engine_is_listed_with_its_hint(monkeypatch, tmp_path, name):
    """What pip installs stands beside each engine that is not installed, also one that plays only by name."""
    entry = registry.ENGINES.get(name) or registry.entry_of_ours(name)
    # where no environment is
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(registry, "entry_of_ours", lambda _: replace(entry, package="no_such_package"))
    monkeypatch.delitem(registry.ENGINES, name, raising=False)
    (hint,) = [row["missing"] for row in engine_rows() if row["engine"] == name]
    assert hint == registry.missing_reason(name)
    assert name not in registry.ENGINES


@pytest.mark.parametrize("form", ["table", "json", "csv"])
def test_show_in_every_format(touchstone, form):
    """A scene is shown with all its bodies; JSON is the whole scenario."""
    code, out, err = touchstone(f"show ball_snip --format {form}")
    assert (code, err) == (0, "")
    scenario = catalogue()["ball_snip"]
    bodies = [body.name for body in scenario.bodies]
    if form == "json":
        shown = json.loads(out)
        assert [body["name"] for body in shown["bodies"]] == bodies
        assert shown["trackers"][0]["times"] == list(scenario.trackers[0].times)
    elif form == "csv":
        assert [row["body"] for row in csv.DictReader(io.StringIO(out))] == bodies
    else:
        assert [line.split()[0] for line in out.splitlines()][-len(bodies) :] == bodies
        assert "expects land ball-floor from 1 to 1.8 s" in out


@pytest.mark.parametrize(
    ("scene", "line"),
    [
        ("bounce_e05", "truth ball: from 0.24731 s at (0, 0, 0.05) m, v = (0, 0, 1.21305) m/s"),
        ("bounce_e05", "arcs more"),
        ("slide", "truth box_0: from 1.22324 s at (3.66972, 0, 0.05) m, at rest"),
        ("slip", "dw/dt = (0, 147.15, 0) rad/s^2"),
        ("spring", "truth light: follows its tracker by Eq. 6, solved in closed form"),
        ("tumble_stable", "truth box: turns freely, by elliptic functions"),
        ("four_bar", "truth rocker: moves with its joints, integrated to rounding"),
        ("slider_spring", "slider  slider  (world)  block  (0, 0, 0)   (0.866025, 0, -0.5)  "),
        ("gripper_lifts", "c 1000, rate 10, at most 20"),
        ("ragdoll_stairs", "0 to 2.4  c 0.5"),
        ("n_bar", "redundant loops: others imply 9 of the joints' 50 equations; the least forces count"),
    ],
)
def test_show_tells_the_truth(touchstone, monkeypatch, scene, line):
    """A probe is shown with how its bodies must move."""
    monkeypatch.setenv("COLUMNS", "200")
    code, out, err = touchstone(f"show {scene}")
    assert (code, err) == (0, "")
    assert line in out


def test_a_narrow_terminal_cuts_no_word(capsys, monkeypatch):
    """A row whose words do not fit beside each other becomes a block; one whose words do is wrapped."""
    row = {"body": "torso", "model": "pinocchio", "remark": "the scene itself"}
    for columns, wanted in (
        ("40", ["body   model      remark", "torso  pinocchio  the scene itself"]),
        ("24", ["body   model      remark", "torso  pinocchio  the", f"{'':18}scene", f"{'':18}itself"]),
        ("20", ["body    torso", "model   pinocchio", "remark  the scene itself"]),
    ):
        monkeypatch.setenv("COLUMNS", columns)
        show_rows([row], "table")
        assert [line.rstrip() for line in capsys.readouterr().out.splitlines()] == wanted


def test_show_says_where_a_path_leaves_its_keyframes(touchstone, lab, tmp_path):
    """A spline through 0, 12.5 mm, 12.5 mm swings far out: a line names tracker, place and remedy."""
    places = ((0.0, 0.0, 0.0), (0.0125, 0.0, 0.0), (0.0125, 0.0, 0.0))
    path = Tracker("hand", (), (0.0, 0.05, 10.0), places, ((1.0, 0.0, 0.0, 0.0),) * 3, ((),) * 3)
    hand = ball("hand", "wood", 0.05, 1.0)
    scene = scene_data(lab.scene(replace(hand, kind="driven"), trackers=(path,), duration=10.0))
    scene["name"] = "hand"
    (tmp_path / "hand.json").write_text(json.dumps(scene))
    assert touchstone("show hand.json")[::2] == (0, "")
    scene["trackers"][0]["interpolation"] = "cubic"
    (tmp_path / "hand.json").write_text(json.dumps(scene))
    line = "hand: trackers[0]: hand leaves its keyframes by 548 mm from 0.05 to 10 s; "
    assert touchstone("show hand.json")[2] == f'{line}interpolation = "pchip" does not\n'


def test_bodies_that_overlap_at_the_start_are_named(touchstone, tmp_path):
    """The pair with its depth, the radius less 0.5692 m; bodies with a common joint may overlap."""
    scene = scene_data(catalogue()["slider_crank"]) | {"name": "own_crank"}
    scene["bodies"][0]["pieces"][0]["shape"]["radius"] = 0.6
    (tmp_path / "crank.json").write_text(json.dumps(scene))
    assert touchstone("show slider_crank")[2] == ""
    code, _, err = touchstone("show crank.json")
    assert (code, err) == (0, "own_crank: crank and piston overlap by 0.0308 m at the start\n")


def test_values_that_no_body_has_are_named_without_tags(touchstone, tmp_path):
    """A scene of its own file; those of the catalogue go beyond on purpose."""
    assert "load_1e6: " not in touchstone("show load_1e6")[2]
    scene = scene_data(catalogue()["load_1e6"]) | {"name": "load", "tags": []}
    (tmp_path / "load.json").write_text(json.dumps(scene))
    assert touchstone("show load.json")[2].startswith(
        "load: box_2: 1e+06 kg in its shapes are 1e+09 kg/m^3; "
    )


def test_effects_that_a_person_lacks_cost_nothing():
    """A plan with one of them more keeps the fat bounds of the plan, and does no other work."""
    scenario = replace(catalogue()["two_arms"], duration=0.5, expectations=())
    added = [names for change, names in toggles(scenario).items() if change.startswith("+")]
    assert len(added) >= 5
    engine, plan = load(REFERENCE), own_settings(REFERENCE)
    base = record(engine, scenario, plan).work
    for names in added:
        settings = replace(plan, effects=names)
        assert planned_for(REFERENCE, scenario, settings)[1].fat_bounds
        assert (record(engine, scenario, settings).work == base).all()
    assert not planned_for(REFERENCE, scenario, replace(plan, effects=PLANNED))[1].fat_bounds


COSTS = {effect: 1e-6 * (k + 1) for k, effect in enumerate(TOGGLED)}
"""Time of an effect in a frame [s]."""


def known(engine, scenario, settings, budget, passes):
    """Variants whose frames take 1 us and the COSTS of their effects."""

    def pace(one):
        ours = planned(scenario).stages if one.effects is None else one.effects
        return Pace(np.full(4, 1e-6 + sum(COSTS.get(effect, 0.0) for effect in ours)), np.zeros(4))

    return [Variant(pace(one), pace(settings[0]), 0.0, 0.0, True, "") for one in settings]


def test_effects_have_a_cost_here(touchstone, refused, monkeypatch):
    """What a frame takes longer with an effect, over a frame of the plan; of those that a scene lacks too."""
    monkeypatch.setattr(effects, "play", known)
    code, out, err = touchstone("show stack --effects --cost --format json")
    assert code == 0, err
    stages = planned(catalogue()["stack"]).stages
    frame = 1e-6 + sum(COSTS.get(effect, 0.0) for effect in stages)
    found = {row["effect"]: float(row["cost [%]"]) for row in json.loads(out) if row["effect"] in COSTS}
    assert found == {effect: pytest.approx(100 * cost / frame, abs=0.5) for effect, cost in COSTS.items()}
    assert not COSTS.keys() <= set(stages)
    assert refused("show stack --cost") == "--cost is a column of --effects; name both"
