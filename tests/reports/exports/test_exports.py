"""Exports of recordings: animated GLB and tables."""

import json
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from touchstone.reports.exports import TABLES, body_mesh, glb
from touchstone.reports.page.run_page import own_columns
from touchstone.reports.results import save, table
from touchstone.scenarios.catalogue import catalogue

COUNTS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


def parsed(data):
    """JSON of a GLB file, and a function that reads an accessor; checks lengths and alignment."""
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    reported = json.loads(data[20 : 20 + size])
    binary, kind = struct.unpack_from("<I4s", data, 20 + size)
    assert kind == b"BIN\0"
    assert (size % 4, binary % 4) == (0, 0)
    start = 28 + size
    assert reported["buffers"][0]["byteLength"] <= binary == len(data) - start

    def read(number):
        accessor = reported["accessors"][number]
        view = reported["bufferViews"][accessor["bufferView"]]
        count = COUNTS[accessor["type"]]
        values = np.frombuffer(data, "<f4", accessor["count"] * count, start + view["byteOffset"])
        values = values.reshape(-1, count)
        assert view["byteLength"] == values.nbytes
        np.testing.assert_array_equal(values.min(axis=0), np.float32(accessor["min"]))
        np.testing.assert_array_equal(values.max(axis=0), np.float32(accessor["max"]))
        return values

    return reported, read


def test_a_glb_moves_as_the_recording(registry):
    """Every body that moves has its positions and orientations at every frame, and every mesh its pieces."""
    recording, scenario = registry.played("slip", "reference"), catalogue()["slip"]
    reported, read = parsed(glb(recording, scenario))
    [animation] = reported["animations"]
    for channel in animation["channels"]:
        body, path = channel["target"]["node"], channel["target"]["path"]
        sampler = animation["samplers"][channel["sampler"]]
        np.testing.assert_allclose(read(sampler["input"])[:, 0], recording.time, atol=1e-6)
        values = read(sampler["output"])
        assert reported["nodes"][body]["name"] == scenario.bodies[body].name
        if path == "translation":
            np.testing.assert_allclose(values, recording.position[:, body], atol=1e-6)
        else:
            turned = (
                Rotation.from_quat(values)
                * Rotation.from_quat(recording.orientation[:, body], scalar_first=True).inv()
            )
            assert turned.magnitude().max() < 1e-6
            assert (np.einsum("fi,fi->f", values[1:], values[:-1]) > 0).all()
    moving = sum(body.kind != "fixed" for body in scenario.bodies)
    assert len(animation["channels"]) == 2 * moving
    root = reported["nodes"][reported["scenes"][0]["nodes"][0]]
    assert len(root["children"]) == len(scenario.bodies)
    up = Rotation.from_quat(root["rotation"]).apply((0.0, 0.0, 1.0))
    np.testing.assert_allclose(up, (0.0, 1.0, 0.0), atol=1e-12)


@pytest.mark.parametrize("name", ["ball_snip", "two_arms", "fall", "tumble_0"])
def test_meshes_are_closed_and_face_outward(name):
    """The signed volume of every piece is that of its hull, and normals have length 1."""
    scenes = catalogue()
    for body in scenes.get(name, scenes["slide"]).bodies:
        for piece in body.pieces:
            corners, normals = body_mesh(replace(body, pieces=(piece,)))
            a, b, c = corners[0::3], corners[1::3], corners[2::3]
            volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
            assert volume == pytest.approx(ConvexHull(corners).volume, rel=1e-6)
            np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-12)
            flat = np.cross(b - a, c - a)
            assert (np.einsum("ij,ij->i", flat, normals[0::3]) > 0).all()


def test_frames_that_are_not_finite_end_the_animation(registry):
    """A run that diverged keeps its frames until then."""
    recording = registry.played("slip", "reference")
    position = recording.position.copy()
    position[7:] = np.nan
    reported, read = parsed(glb(replace(recording, position=position), catalogue()["slip"]))
    assert len(read(reported["animations"][0]["samplers"][0]["input"])) == 7


def test_tables_hold_the_recording(registry):
    """Bodies, joints and contacts come back by name."""
    recording, scenario = registry.played("ball_snip", "reference"), catalogue()["ball_snip"]
    found = {name: build(recording, scenario) for name, build in TABLES.items()}
    ball = found["bodies"][found["bodies"].body == "ball"]
    k = scenario.body_index("ball")
    np.testing.assert_array_equal(ball[["x", "y", "z"]], recording.position[:, k])
    np.testing.assert_array_equal(ball[["wx", "wy", "wz"]], recording.angular_velocity[:, k])
    second = scenario.trackers[0].joints[1]
    angles = found["joints"][found["joints"].joint == second].angle
    np.testing.assert_array_equal(angles, recording.joint_angle[:, 1])
    assert len(found["contacts"]) == len(recording.contacts)
    np.testing.assert_array_equal(found["contacts"].jz, recording.contacts["impulse"][:, 2])


@pytest.fixture
def stored(registry, tmp_path):
    """A stored run with a recording of `slip`."""
    folder = tmp_path / "run"
    (folder / "recordings").mkdir(parents=True)
    registry.played("slip", "reference").save(folder / "recordings" / "slip-reference-balanced.npz")
    rows = registry.judged_rows("slip", "reference")

    save(table(rows), folder)
    return folder


def test_export_and_view_from_the_command_line(touchstone, stored, tmp_path):
    """Files are written once; the page holds the playback."""
    recording = stored / "recordings" / "slip-reference-balanced.npz"
    assert touchstone("export", recording, "--format", "glb")[:2] == (0, "slip-reference-balanced.glb\n")
    assert touchstone("export", recording, "--format", "parquet", "--out", "a.parquet")[0] == 0
    code, out, _ = touchstone("export", recording, "--format", "csv", "--table", "contacts")
    assert code == 0
    assert out.startswith("time,body_a,body_b,distance,x,y,z,nx,ny,nz,jx,jy,jz\n")
    assert len(pd.read_parquet("a.parquet")) > 100
    code, out, _ = touchstone("view", stored, "--no-open")
    page = stored / "view-slip.html"
    assert (code, out) == (0, f"{page}\n")
    text = page.read_text("utf-8")
    assert "reference" in text
    assert "<title>touchstone: slip</title>" in text


def test_a_browser_that_is_missing_is_told(touchstone, stored, monkeypatch):
    """The page is written all the same."""
    import webbrowser

    asked = []
    monkeypatch.setattr(webbrowser, "open", lambda url: asked.append(url))
    code, _, err = touchstone("view", stored, "slip", "--out", "page.html")
    assert (code, err) == (0, "no browser was found; open the page by hand\n")
    assert asked[0].startswith("file://")
    assert asked[0].endswith("page.html#play=slip")


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("export RUN/none.npz --format glb", "none.npz: no such file"),
        ("export RUN/recordings/slip-reference-balanced.npz --format urdf", "is for scenes; of a rec"),
        ("export slip --format glb", "is for recordings, such as runs/TIME/recordings/NAME.npz"),
        ("export RUN/broken.npz --format csv", "not a recording"),
        ("view nowhere", "nowhere: no such folder"),
        ("view RUN slid", "did you mean 'slip'"),
        ("view RUN slip --engine bullet", "unknown engine 'bullet' (valid: reference)"),
        ("view RUN --profile paper", "unknown profile 'paper' (valid: balanced)"),
        ("view RUN --no-open --out RUN/broken.npz", "broken.npz: exists"),
        ("view RUN --no-open --out no/a.html", "--out no/a.html: No such file or directory"),
        ("export slip --format toml --out RUN/broken.npz", "broken.npz: exists"),
        ("export slip --format toml --out no/a.toml", "--out no/a.toml: No such file"),
    ],
)
def test_wrong_arguments_are_one_line(refused, stored, command, said):
    """Exit 2, one line, nothing written."""
    (stored / "broken.npz").write_bytes(b"PK\x03\x04")
    before = sorted(stored.rglob("*"))
    assert said in refused(command.replace("RUN", str(stored)))
    assert sorted(stored.rglob("*")) == before


def test_the_page_shows_each_engine_in_its_own_profile():
    """Of several profiles, the engine's own; without it, the first that was played."""

    played = [
        ("reference", "paper"),
        ("reference", "balanced"),
        ("dart", "accurate"),
        ("mine", "a"),
        ("mine", "b"),
    ]
    found = own_columns({column: Path("x") for column in played})
    assert list(found) == [("reference", "balanced"), ("dart", "accurate"), ("mine", "a")]
