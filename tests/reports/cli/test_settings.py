"""`sweep`, `cheapest`, `tune`, `reproduce`, `challenge`: what was measured stays, what is printed plays."""

import json
import re
import subprocess
import sys
from io import StringIO
from pathlib import Path
from zlib import crc32

import numpy as np
import pandas as pd
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.knobs import Choice
from touchstone.adapters.registry import (
    ENGINES,
    changes_of,
    installed,
    missing_reason,
    registered,
    settings_of,
)
from touchstone.reports.cli.challenge import settings_file
from touchstone.reports.studies.study import RefusedError
from touchstone.reports.studies.tuning import Asked, Search, Space, cost_lines, tuned_lines, values_of
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.files.write import scene_toml


def test_a_sweep_is_printed_and_kept(touchstone, refused, tmp_path):
    """Steps and settings make cells, the second call measures none, another version is refused."""
    asked = "sweep fall --engine mujoco --profile recommended --jobs 1 --dt 1/60,1/240"
    code, out, err = touchstone(f"{asked} --set mujoco.integrator=Euler,RK4 --set numSubSteps=1,2")
    assert code == 0, err
    assert "4 cells" in out
    assert "integrator=RK4" in out
    files = sorted((tmp_path / "runs" / "sweep" / "cells").iterdir())
    code, out, _ = touchstone(f"{asked} --set mujoco.integrator=Euler,RK4 --format csv --quiet")
    assert code == 0
    assert out.count("\n") > 40
    assert sorted((tmp_path / "runs" / "sweep" / "cells").iterdir()) == files
    (tmp_path / "runs" / "sweep" / "store.json").write_text('{"format": 99}')
    assert refused(asked) == "runs/sweep: store of version 99, this program writes 1"


@pytest.mark.parametrize(
    "command",
    [
        "sweep fall --jobs 1",
        "cheapest fall --position 1mm --quick --jobs 1",
        "tune fall --position 1mm --quick --jobs 1",
        "check-engine",
        "run fall",
        "study calibration",
        "study convergence slip",
        "study effects fall",
        "study relations",
        "study robustness",
        "study stability",
        pytest.param("study work-precision fall --quick --jobs 1", marks=pytest.mark.slow),
    ],
)
def test_a_missing_engine_is_told_in_quiet(touchstone, command):
    """Exit 3 has its line under `--quiet`, for an engine without our usual profiles too."""
    if installed("drake"):
        pytest.skip("drake is installed")
    engine = "drake" if command == "check-engine" else "--engine drake"
    code, out, err = touchstone(f"{command} {engine} --quiet")
    assert (code, out) == (3, ""), err
    assert missing_reason("drake") in err


def test_a_slurm_script_is_written(touchstone, refused, tmp_path):
    """The script repeats the command with an absolute store, and nothing is measured."""
    code, out, _ = touchstone("sweep fall --engine mujoco --slurm-script job.sh --jobs 4")
    assert (code, out) == (0, "sbatch job.sh\n")
    text = (tmp_path / "job.sh").read_text()
    assert f"--engine mujoco --out {tmp_path}/runs/sweep --jobs 1" in text
    assert "slurm-script" not in text
    assert subprocess.run(["bash", "-n", "job.sh"], cwd=tmp_path, check=False).returncode == 0
    for name, said in (("job.sh", "exists"), ("no/job.sh", "No such file or directory")):
        command = f"sweep fall --engine mujoco --slurm-script {name}"
        assert refused(command) == f"--slurm-script {name}: {said}"
    assert (tmp_path / "job.sh").read_text() == text
    assert sorted(path.name for path in tmp_path.iterdir()) == ["job.sh"]


@pytest.mark.slow
def test_the_line_of_an_answer_meets_its_tolerances(touchstone):
    """The command that `cheapest` names, run again, has the overlap that was asked for."""
    code, out, err = touchstone("cheapest bounce_e05 --overlap 5mm --engine bullet --quick")
    assert code == 0, err
    line = next(text for text in out.splitlines() if text.startswith("again: touchstone "))
    again = line.removeprefix("again: touchstone ")
    code, out, err = touchstone(f"{again} --format csv --quiet --metric overlap.max")
    found = pd.read_csv(StringIO(out))
    assert found[found.metric == "overlap.max"].value.max() <= 5e-3
    code, out, _ = touchstone("cheapest bounce_e05 --overlap 1um --engine bullet --quick")
    assert code == 1
    assert out.startswith("nothing measured meets all; nearest miss: bullet ")
    assert "times too much" in out


def test_seeds_and_times(touchstone):
    """A seed perturbs the scene and has a line of its own; each cell is timed in as many rounds as asked."""
    asked = "sweep collide_sticks --engine mujoco --profile recommended --jobs 1"
    asked += " --seed 0,1 --timing --repeats 2"
    code, out, err = touchstone(f"{asked} --format csv --quiet")
    assert code == 0, err
    frame = pd.read_csv(StringIO(out))
    runs = frame[frame.metric == "run"]
    kinds = runs.measure.str.rpartition(":")[2].value_counts().to_dict()
    assert kinds == {"accuracy": 2, "timing": 4}
    assert runs[runs.measure.str.endswith("timing")].value.min() > 0
    ends = frame[(frame.metric == "overlap.max") & frame.measure.str.endswith("accuracy")]
    assert sorted(ends.seed) == [0, 1]
    code, out, _ = touchstone(asked)
    assert code == 0
    assert "frame [us]" in out
    assert "seed" in out


@pytest.mark.parametrize("engine", ["mujoco", "bullet", "dart", "drake"])
def test_values_are_valid_and_reach_every_setting(engine):
    """Every setting has another value than its profiles', and the table takes all of them."""
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
    start = Settings("recommended", 1 / 240, ("impratio=3.0",))
    for _ in range(50):
        near = space.near(start, [Settings("recommended", 1 / 60, ("solver=CG",))], rng)
        assert near.profile == start.profile
        assert (near.dt != start.dt) != (near.changes != start.changes)
        assert settings_of("mujoco").changes(near.profile, near.changes) == near.changes
    assert [step for step in space.steps if round(1 / step) % 60] == []


@pytest.fixture
def mujoco(registry):
    """Skip where MuJoCo is not installed."""
    return registry.engine("mujoco")


@pytest.mark.parametrize(("engine", "plays"), [("mujoco", 8), ("mujoco", 60), ("bullet", 61), ("dart", 240)])
def test_a_search_tries_as_many_settings_as_it_says(monkeypatch, tmp_path, engine, plays):
    """As many different settings are played as are asked for."""
    scenes = {"bounce_e05": catalogue()["bounce_e05"]}
    search = Search(Asked(engine, scenes, {"position": 1e-3}, plays, 1, 0, tmp_path), lambda *_: None)

    def play(candidates, names):
        for one in candidates:
            error = 1e-5 * (crc32(repr(one).encode()) % 997)
            search._errors[one, names[0]] = {"position": error}, one.dt

    monkeypatch.setattr(search, "_play", play)
    monkeypatch.setattr(
        search, "_timed", lambda found: {one: search._setting(one, [*scenes]) for one in found}
    )
    found = search.run()
    assert found.tried == plays
    assert f"{plays} settings of " in cost_lines(search._asked)[0]
    assert f" of {plays} settings: " in tuned_lines(search._asked, found, [])[0]


@pytest.mark.slow
def test_a_search_prints_what_plays_again(touchstone, mujoco, tmp_path):
    """A search of a file's scene ends within its limits, resumes from its store, and its command plays."""
    (tmp_path / "mine.toml").write_text(scene_toml(catalogue()["bounce_e05"]))
    asked = "tune mine.toml --engine mujoco --position 20cm --plays 8 --store store --format json"
    code, out, err = touchstone(asked)
    assert code == 0, err
    assert "8 settings of" in err
    rows = json.loads(out)
    best = rows[0]
    assert best["place"] == "best"
    assert best["error position"] <= best["limit position"] == 0.2
    assert best["excess"] <= 1
    assert "<option timestep=" in best["paste"]
    assert {row["profile"] for row in rows if row["place"] == "profile"} == set(ENGINES["mujoco"].profiles)
    again, text, noise = touchstone(asked)
    assert again == 0
    assert json.loads(text) == rows
    assert re.findall(r"mujoco .* 1/", noise) == []  # nothing was played


@pytest.mark.slow
def test_the_nearest_is_printed_where_nothing_reaches(touchstone, mujoco):
    """An unreachable limit is exit 1, with the nearest setting and by how much it misses."""
    code, out, _ = touchstone("tune bounce_e05 --engine mujoco --position 0m --plays 8 --store store")
    assert code == 1
    assert out.startswith("no setting reaches the limits; nearest of ")
    assert "too much" in out


def test_a_quantity_that_no_run_has_is_named(refused, mujoco):
    """Friction where nothing slides is bad input; the message says what there is."""
    said = refused("tune fall --engine mujoco --friction 2% --plays 8 --store store --quiet")
    assert "no friction is measured here; there is position" in said
    assert issubclass(RefusedError, ValueError)


def test_a_script_runs_without_us(touchstone, refused, mujoco):
    """The file that `reproduce` writes names what misses its limit, and plays in a bare interpreter."""
    command = "reproduce slide --engine mujoco --out slide.py"
    code, out, err = touchstone(command)
    assert (code, out) == (0, "")
    assert "prints the positions of the recording to the bit" in err
    done = subprocess.run([sys.executable, "-I", "slide.py"], capture_output=True, text=True, check=True)
    assert re.search(r"box_0 is [\d.]+ m from the closed form", done.stdout)
    assert "exists" in refused(command)


FILES = sorted((Path(__file__).parents[3] / "challenges").glob("*.toml"))
SOFT = 'engine = "mujoco"\nsource = "https://mujoco.org"\nby = "me"\n[settings]\nsolref = "{}"\n'


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_files_are_valid(path):
    """Each names an engine, a profile of it, and settings that change this profile."""
    found = settings_file(path)
    assert found.profile in ENGINES[found.engine].profiles
    texts = [f"{key}={value}" for key, value in found.settings.items()]
    assert len(changes_of(found.engine, found.profile, texts)) == len(texts)


@pytest.mark.slow
def test_worse_settings_are_exit_1(touchstone, refused, mujoco, tmp_path):
    """Contacts of 0.2 s break limits of a stack that `recommended` meets; those of 5 ms break none."""
    for value, wanted in (("0.2", 1), ("0.005", 0)):
        (tmp_path / "soft.toml").write_text(SOFT.format(value))
        code, out, _ = touchstone(f"challenge soft.toml stack --out {value}")
        assert code == wanted
        assert f"solref={value}" in out
        assert ("worse: stack +" in out) == bool(code)
    assert "exists" in refused("challenge soft.toml stack --out 0.2")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (SOFT.partition("[settings]")[0], "settings: missing"),
        ('profil = "x"\n' + SOFT.format("0.01"), "profil: unknown field 'profil'"),
        (SOFT.format("0.01").replace("mujoco", "mujco"), "did you mean 'mujoco'"),
        (SOFT.format("0.01").replace("solref", "solrf"), "did you mean 'solref'?"),
        (SOFT.format("-1"), "solref: found '-1'"),
        ('dt = "1/7"\n' + SOFT.format("0.01"), "--dt 1/7:"),
        ('profile = "recomended"\n' + SOFT.format("0.01"), "did you mean 'recommended'?"),
    ],
)
def test_a_wrong_file_is_one_line(text, message, refused, mujoco, tmp_path):
    """What was found and what is valid, exit 2, and nothing is played."""
    (tmp_path / "wrong.toml").write_text(text)
    assert message in refused("challenge wrong.toml stack --out out")
    assert not (tmp_path / "out").exists()
