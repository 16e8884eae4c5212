"""`touchstone tune` and `reproduce`: wrong input is one line; what they print plays again."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest

from touchstone.adapters.knobs import Choice
from touchstone.adapters.registry import ENGINES, installed, settings_of
from touchstone.reports.studies.study import RefusedError
from touchstone.reports.studies.tuning import Candidate, Space, values_of
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.files.write import scene_toml


@pytest.mark.parametrize("engine", ["mujoco", "bullet", "dart", "drake"])
def test_values_are_valid_and_reach_every_setting(engine):
    """Every setting has another value than its profiles', and the table takes all of them."""
    from touchstone.adapters.registry import registered

    table = settings_of(registered(engine))
    for name, setting in table.items():
        found = values_of(setting)
        for text in found:
            table.parse(text)
        plain = {f"{name}={value}" for value in setting.profiles if value}
        least = len(setting.values) if isinstance(setting, Choice) else len(plain) + 1
        assert len({table.parse(text)[1] for text in found} | plain) >= least


def test_a_neighbour_differs_in_one_thing():
    """A new candidate has another step, or other changes, and its changes are valid in its profile."""
    space, rng = Space("mujoco", [catalogue()["slide"]]), np.random.default_rng(0)
    start = Candidate("recommended", 1 / 240, ("impratio=3.0",))
    for _ in range(50):
        near = space.near(start, [Candidate("recommended", 1 / 60, ("solver=CG",))], rng)
        assert near.profile == start.profile
        assert (near.dt != start.dt) != (near.changes != start.changes)
        assert settings_of("mujoco").changes(near.profile, near.changes) == near.changes
    assert [step for step in space.steps if round(1 / step) % 60] == []


def needs_mujoco():
    if not installed("mujoco"):
        pytest.skip("mujoco is not installed")


@pytest.mark.slow
def test_a_search_prints_what_plays_again(touchstone, tmp_path):
    """A search of a file's scene ends within its limits, resumes from its store, and its command plays."""
    needs_mujoco()
    scene = tmp_path / "mine.toml"
    scene.write_text(scene_toml(catalogue()["bounce_e05"]))
    asked = ["tune", str(scene), "--engine", "mujoco", "--position", "20cm", "--plays", "8"]
    asked += ["--store", str(tmp_path / "store"), "--format", "json"]
    code, out, err = touchstone(*asked)
    assert code == 0, err
    assert "8 settings of" in err
    rows = json.loads(out)
    best = rows[0]
    assert best["place"] == "best"
    assert best["error position"] <= best["limit position"] == 0.2
    assert best["excess"] <= 1
    assert "<option timestep=" in best["paste"]
    assert {row["profile"] for row in rows if row["place"] == "profile"} == set(ENGINES["mujoco"].profiles)
    again, text, noise = touchstone(*asked)
    assert again == 0
    assert json.loads(text) == rows
    assert re.findall(r"mujoco .* 1/", noise) == []  # nothing was played


@pytest.mark.slow
def test_the_nearest_is_printed_where_nothing_reaches(touchstone, tmp_path):
    """An unreachable limit is exit 1, with the nearest setting and by how much it misses."""
    needs_mujoco()
    asked = ["tune", "bounce_e05", "--engine", "mujoco", "--position", "0m", "--plays", "8"]
    code, out, _ = touchstone(*asked, "--store", str(tmp_path / "store"))
    assert code == 1
    assert out.startswith("no setting reaches the limits; nearest of ")
    assert "too much" in out


def test_a_quantity_that_no_run_has_is_named(touchstone, tmp_path):
    """Friction where nothing slides is bad input; the message says what there is."""
    needs_mujoco()
    code, _, err = touchstone(
        *("tune", "fall", "--engine", "mujoco", "--friction", "2%", "--plays", "8", "--quiet"),
        *("--store", str(tmp_path / "store")),
    )
    assert code == 2
    assert "no friction is measured here; there is position" in err
    assert issubclass(RefusedError, ValueError)


def test_a_script_runs_without_us(touchstone, tmp_path):
    """The file that `reproduce` writes names what misses its limit, and plays in a bare interpreter."""
    needs_mujoco()
    script = tmp_path / "slide.py"
    code, out, err = touchstone("reproduce", "slide", "--engine", "mujoco", "--out", str(script))
    assert (code, out) == (0, "")
    assert "prints the positions of the recording to the bit" in err
    done = subprocess.run([sys.executable, "-I", script], capture_output=True, text=True, check=True)
    assert re.search(r"box_0 is [\d.]+ m from the closed form", done.stdout)
    code, _, err = touchstone("reproduce", "slide", "--engine", "mujoco", "--out", str(script))
    assert code == 2
    assert "exists" in err
