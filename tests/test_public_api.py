"""`import touchstone`: names that work in scripts, from standard input and beside the user's packages."""

import subprocess
import sys
from pathlib import Path

import pytest

import touchstone
from touchstone.reports import api
from touchstone.reports.metrics.motion.time_series import Course
from touchstone.reports.results import table
from touchstone.reports.runner.request import Request

PLAY = """
import touchstone
results = touchstone.run("fall", engines=["reference"], profiles=["balanced"])
print(results.recordings["fall", "reference", "balanced"].position.shape[1:], len(results.frame) > 10)
"""


def test_every_public_name_exists():
    """Each name of `__all__` can be used, and no other is offered."""
    for name in touchstone.__all__:
        assert getattr(touchstone, name) is not None
    assert dir(touchstone) == sorted(touchstone.__all__)
    with pytest.raises(AttributeError, match="its names are Body, "):
        _ = touchstone.nothing


def test_scenarios_are_listed_by_name_and_tag():
    """`touchstone.scenarios()` is the catalogue, a dict of scenarios."""
    found = touchstone.scenarios()
    assert isinstance(found["ball_snip"], touchstone.Scenario)
    gallery = touchstone.scenarios("gallery")
    assert 0 < len(gallery) < len(found)
    assert all("gallery" in scene.tags for scene in gallery.values())


def test_what_a_script_prints_is_short(registry):
    """Scenarios and all their parts, recordings, manifests, requests and results print a line or a few."""
    recording = registry.played("ball_snip", "reference")
    scenes = list(touchstone.scenarios().values())
    request = Request(tuple(scenes), (("reference", "balanced"),), Path("out"))
    rows = registry.judged_rows("ball_snip", "reference")
    frame = table(rows)
    results = touchstone.Results(frame, {("ball_snip", "reference", "balanced"): recording})
    printed = [recording, request, results, Course(recording.time, {("overlap.max", ""): recording.time})]
    for scene in scenes:
        printed += [scene, *scene.bodies, *scene.trackers, *scene.truths, *scene.chains, *scene.joints]
        printed += [piece for body in scene.bodies for piece in body.pieces]
    for one in printed:
        assert len(repr(one)) < 1000
        assert repr(one).count("\n") < 5
    assert repr(results).startswith(f"<Results: scenes 1, columns 1, rows {len(frame)}, recordings 1; ")
    assert f"{(frame.verdict == 'pass').sum()} pass" in repr(results)
    assert "position=<array (" in repr(recording)


@pytest.mark.parametrize("name", ["run", "sweep", "work_precision"])
@pytest.mark.parametrize(("engine", "told"), [("reference", True), ("mujoco", False)])
def test_a_compilation_is_told(monkeypatch, capsys, name, engine, told):
    """A function that plays the reference says in one line on standard error that it compiles first."""
    said = "compiling the reference, once per version of it: about 60 s"
    monkeypatch.setattr(api, "announcement", lambda: said)
    monkeypatch.setattr(api, "scratch_folder", lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        getattr(touchstone, name)("fall", engine)
    # the study of work and precision also plays the reference for its converged solutions
    assert capsys.readouterr().err == f"{said}\n" * (told or name == "work_precision")


@pytest.mark.parametrize("way", [pytest.param("standard input", marks=pytest.mark.slow), "script"])
def test_a_run_needs_no_guard_and_no_free_names(tmp_path: Path, way: str):
    """A script without a `__main__` guard runs in a folder that has packages called like ours."""
    for name in ("adapters", "reports", "scenarios", "reference_impl"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise ImportError('not this one')\n")
    (tmp_path / "script.py").write_text(PLAY)
    arguments = ["-"] if way == "standard input" else ["script.py"]
    done = subprocess.run(
        [sys.executable, *arguments],
        input=PLAY if way == "standard input" else None,
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert (done.stdout, done.returncode) == ("(1, 3) True\n", 0), done.stderr


def test_a_saved_run_is_loaded_again(tmp_path: Path, forked):
    """With `out` the folder stays, and `touchstone.load` reads its recordings."""
    results = touchstone.run(["fall"], ["reference"], ["balanced"], out=tmp_path / "kept")
    recording = touchstone.load(tmp_path / "kept" / "recordings" / "fall-reference-balanced.npz")
    played = results.recordings["fall", "reference", "balanced"]
    assert (recording.position == played.position).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scenes": "fal"}, r"unknown scene 'fal'; did you mean 'fall'"),
        ({"scenes": "fall", "engines": ["mujco"]}, r"unknown engine 'mujco'; did you mean 'mujoco'"),
        ({"scenes": "fall", "profiles": ["best"]}, r"unknown profile 'best'"),
        ({"scenes": "fall", "engines": ["mujoco"], "profiles": ["paper"]}, r"no engine of mujoco has"),
        ({"scenes": []}, r"expected one or more"),
        ({"scenes": ["fall", "fall"]}, r"each with a name of its own"),
        ({"scenes": "fall", "engines": "mujco"}, r"unknown engine 'mujco'"),
        ({"scenes": "fall", "dt": 0.013}, r"does not divide the frame"),
        ({"scenes": "fall", "dt": float("nan")}, r"is no step"),
    ],
)
def test_wrong_input_names_what_is_valid(arguments: dict, message: str):
    """A wrong name or step gives one line that names the valid choices."""
    with pytest.raises(ValueError, match=message):
        touchstone.run(**arguments)
