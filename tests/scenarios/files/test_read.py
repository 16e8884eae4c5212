"""Scene files that are wrong: every fault at once, with file, line and field."""

import numpy as np
import pytest

from touchstone.scenarios.files.named import scenes_of_file
from touchstone.scenarios.files.read import SceneFileError, read_scene
from touchstone.scenarios.files.schema import json_schema
from touchstone.scenarios.files.write import scene_json
from touchstone.scenarios.rounded_solid import rounded_mass_properties
from touchstone.scenarios.scenario import Capsule, Cone, HalfSpace, Piece, RoundedBox, RoundedHull
from touchstone.scenarios.solids import capsule_inertia

SOUND = """\
summary = "a ball drops"
duration = 1.0
coefficients = [{ material_a = "wood", material_b = "wood", restitution = 0.5, friction = 0.3 }]

[[bodies]]
name = "ball"
kind = "simulated"
material = "wood"
mass = 0.2
pieces = [{ name = "ball", shape = { radius = 0.05 } }]
"""
HAND = """
[[bodies]]
name = "glove"
kind = "driven"
material = "wood"
mass = 0.4
pieces = [{ name = "glove", shape = { type = "sphere", radius = 0.05 } }]

[[trackers]]
root = "glove"
file = "glove.csv"
"""
CSV = "time,x,y,z,qw,qx,qy,qz\n0,0,0,1,1,0,0,0\n1,0.5,0,1,1,0,0,0\n"


@pytest.fixture
def scene(tmp_path):
    """Write a file and read it; returns the scenario, or the lines of its faults."""

    def read(text: str, name: str = "drop.toml", **options):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        try:
            return read_scene(path, **options)
        except SceneFileError as error:
            return str(error).replace(f"{tmp_path}/", "").splitlines()

    return read


def test_a_short_file_is_a_whole_scene(scene):
    """Name, tags and inertia follow from the file's name and the pieces; a shape is known by its fields."""
    found = scene(SOUND)
    assert (found.name, found.tags, found.limits) == ("drop", (), ())
    assert found.bodies[0].inertia[0][0] == pytest.approx(0.4 * 0.2 * 0.05**2, rel=1e-15)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("pieces =", "peices =", "10: bodies[0].peices: unknown field 'peices'; did you mean 'pieces'"),
        ("mass =", "mas =", "9: bodies[0].mas: unknown field 'mas'; did you mean 'mass'"),
        ("mass =", "shape =", "9: bodies[0].shape: unknown field 'shape'; pieces have it"),
        ('"simulated"', '"simulatd"', "7: bodies[0].kind: found 'simulatd', expected 'fixed', 'sim"),
        ("duration = 1.0", 'duration = "1"', "2: duration: found '1', expected a valid number"),
        ("duration = 1.0\n", "", "1: duration: missing"),
        ("duration", "gravity = 9.81\nduration", "2: gravity: found 9.81, expected a list of 3 numbers"),
        (
            *("duration", "gravity = [0, 0, 1, 2]\nduration"),
            "2: gravity: found [0, 0, 1, 2], expected at most 3 ",
        ),
        ("duration", "trackers = [3]\nduration", "2: trackers[0]: found 3, expected a table of fields"),
        ("duration", "trackers = 3\nduration", "2: trackers: found 3, expected a list"),
        ("radius = 0.05", "radius = -1.0", "10: bodies[0].pieces[0].shape.radius: found -1.0"),
        (
            *("radius = 0.05", "radus = 0.05"),
            "10: bodies[0].pieces[0].shape: found no shape: unknown field 'radus'; did you mean ",
        ),
        ("radius", 'type = "ball", radius', "10: bodies[0].pieces[0].shape: unknown type 'ball'"),
        ("0.2\n", "0.2\ncenter_of_mass = [0, 0, 1]\n", "5: bodies[0].inertia: missing: a body"),
        ("friction = 0.3", "friction = nan", "3: coefficients[0].friction: found nan"),
        ("0.05 } }]", "0.05 } }", "11: not TOML: Unclosed array"),
        ("[[bodies]]", "[bodies", "5: not TOML: "),
        ('summary = "a', 'name = "../out"\nsummary = "a', "1: name: found '../out', expected up to"),
    ],
)
def test_a_fault_has_its_line(scene, old, new, expected):
    """Name file, line, field, what was found and what is expected."""
    assert old in SOUND
    found = scene(SOUND.replace(old, new, 1))
    assert any(line.startswith(f"drop.toml:{expected}") for line in found)


def test_all_faults_are_told_at_once(scene):
    """Unknown fields do not hide what the scene itself refuses."""
    text = SOUND.replace("mass =", "weight = 1.0\nmass =").replace("0.05", "-1.0")
    text = text.replace("restitution = 0.5", "restitution = 2.0")
    found = scene(text)
    assert [line.split(": ")[1] for line in found] == [
        "coefficients[0].restitution",
        "bodies[0].weight",
        "bodies[0].pieces[0].shape.radius",
    ]


def test_wrong_types_do_not_hide_wrong_values(scene):
    """Wrong types and wrong values are reported together, without what follows from a wrong field alone."""
    text = SOUND.replace("duration = 1.0", "duration = '1 s'").replace("mass = 0.2", "mass = '0.2 kg'")
    text = text.replace("restitution = 0.5, friction = 0.3", "restitution = '0.5', friction = 0.3")
    ball = SOUND[SOUND.index("[[bodies]]") :].replace('name = "ball"', 'name = "two"')
    text += ball.replace('"wood"', '"steel"') + "orientation = [1, 0, 0.5, 0]\n"
    text += ball.replace('"two"', '"three"').replace("radius", "radus").replace("mass", "linear_velocity")
    times = "earliest = 2.0\nlatest = 3.0\n"
    text += f'[[expectations]]\nevent = "meet"\nbody = "ball"\nother = "two"\n{times}'
    assert [line.split(": ")[1] for line in scene(text)] == [
        "duration",
        "coefficients[0].restitution",
        "bodies[0].mass",
        "bodies[1].material",
        "bodies[1].orientation",
        "bodies[2].linear_velocity",
        "bodies[2].pieces[0].shape",
    ]
    assert [line.split(": ")[1] for line in scene(text.replace('body = "ball"', "body = 3"))] == [
        "duration",
        "coefficients[0].restitution",
        "bodies[0].mass",
        "bodies[2].linear_velocity",
        "bodies[2].pieces[0].shape",
        "expectations[0].body",
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('{"name": "a",\n "name": "b"}', "x.json: not JSON: the field 'name' is named twice"),
        ('{"duration": 1,\n}', "x.json:2: not JSON: "),
        ("[1, 2]", "x.json:1: expected a table of fields"),
        ("[" * 100_000, "x.json: "),
        ('{"duration": 1.0,\n "bodies": [],\n\n "coefficients": 3}', "x.json:4: coefficients: found 3"),
    ],
)
def test_json_is_refused_by_line(scene, text, expected):
    """JSON has the same faults as TOML, and its own."""
    assert scene(text, "x.json")[0].startswith(expected)


def test_files_that_cannot_be_read(tmp_path):
    """A missing file, a folder and a file that is no text: one line each."""
    (tmp_path / "bin.toml").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "dir.toml").mkdir()
    for name, reason in (
        ("none.toml", "No such file"),
        ("dir.toml", "is a folder, expected a file"),
        ("bin.toml", "not a text"),
    ):
        with pytest.raises(SceneFileError, match=rf"{name}: {reason}"):
            read_scene(tmp_path / name)


def test_a_tracker_reads_its_file(scene, tmp_path):
    """CSV and NPZ give the keyframes; a file with other columns, shapes or texts is named with its line."""
    text = SOUND + HAND
    (tmp_path / "glove.csv").write_text(CSV)
    tracker = scene(text).trackers[0]
    assert (tracker.times, tracker.positions[1], tracker.angles) == ((0.0, 1.0), (0.5, 0.0, 1.0), ((), ()))
    place, turn = np.array([[0, 0, 1], [0.5, 0, 1]]), np.tile([1.0, 0, 0, 0], (2, 1))
    np.savez(tmp_path / "glove.npz", time=[0.0, 1.0], position=place, orientation=turn)
    assert scene(text.replace(".csv", ".npz")).trackers[0] == tracker
    (tmp_path / "glove.csv").write_text(CSV.replace("0.5", "half"))
    assert scene(text) == ["drop.toml:21: trackers[0].file: glove.csv:3: expected 8 numbers"]
    (tmp_path / "glove.csv").write_text(CSV.replace("time,x", "t,x"))
    assert scene(text)[0].endswith("glove.csv:1: columns: missing time; unknown t")
    np.savez(tmp_path / "glove.npz", time=[0.0, 1.0], position=place[:1], orientation=turn)
    assert scene(text.replace(".csv", ".npz"))[0].endswith("position has shape (1, 3), expected (2, 3)")
    (tmp_path / "glove.npz").write_bytes(b"nothing")
    assert "glove.npz: no NPZ file of plain numbers" in scene(text.replace(".csv", ".npz"))[0]
    # the first array is said to be encrypted, or of an unknown method of compression
    for offset, byte in ((8, 1), (10, 99)):
        np.savez(tmp_path / "glove.npz", time=[0.0, 1.0], position=place, orientation=turn)
        data = bytearray((tmp_path / "glove.npz").read_bytes())
        data[data.index(b"PK\x01\x02") + offset] = byte
        (tmp_path / "glove.npz").write_bytes(data)
        assert "glove.npz: no NPZ file of plain numbers" in scene(text.replace(".csv", ".npz"))[0]
    assert scene(text.replace("glove.csv", "none.csv"))[0].endswith("none.csv: No such file or directory")
    assert scene(text.replace('file = "glove.csv"', ""))[0].startswith("drop.toml:19: trackers[0]: no times")


def test_the_mark_of_utf8_is_no_text(scene, tmp_path):
    """Files that start with the byte order mark, as some editors and spreadsheets write them, are read."""
    mark = "\ufeff"
    (tmp_path / "glove.csv").write_text(mark + CSV)
    found = scene(mark + SOUND + HAND)
    assert found.trackers[0].times == (0.0, 1.0)
    assert scene(mark + scene_json(found), "drop.json").bodies == found.bodies


def test_no_file_outside_the_folder_is_read(scene, tmp_path):
    """A path that leads out, directly or by a link, needs leave."""
    outside = tmp_path.parent / f"{tmp_path.name}-outside.csv"
    outside.write_text(CSV)
    (tmp_path / "link.csv").symlink_to(outside)
    for name in (str(outside), f"../{outside.name}", "link.csv"):
        text = SOUND + HAND.replace("glove.csv", name)
        assert "lies outside the folder" in scene(text)[0]
        assert "allow it by --allow-paths" in scene(text)[0]
        assert scene(text, allow_paths=True).trackers[0].times == (0.0, 1.0)


def test_a_body_of_several_pieces_is_uniform(scene):
    """Two halves of a capsule's mirror image weigh as one: the inertia is that of the sum of solids."""
    two = SOUND.replace(
        "{ radius = 0.05 } }",
        "{ radius = 0.1, half_length = 0.2 }, position = [0.0, 0.0, 1.0] }, "
        '{ name = "b", shape = { radius = 0.1, half_length = 0.2 }, position = [0.0, 0.0, -1.0] }',
    )
    body = scene(two).bodies[0]
    assert isinstance(body.pieces[0], Piece)
    assert isinstance(body.pieces[0].shape, Capsule)
    own = np.array(capsule_inertia(0.1, 0.1, 0.2)) * 2
    assert body.center_of_mass == (0.0, 0.0, 0.0)
    assert np.allclose(body.inertia, own + 0.2 * np.diag([1.0, 1.0, 0.0]), rtol=1e-14)


def test_python_files_give_marked_scenes(tmp_path):
    """Functions marked @scene give scenes; what fails is named with its line, without a traceback."""
    path = tmp_path / "mine.py"
    path.write_text(
        "from dataclasses import replace\n"
        "from touchstone.scenarios.catalogue import catalogue, scene\n"
        "@scene\ndef two():\n    fall = catalogue()['fall']\n"
        "    return replace(fall, name='one', tags=()), replace(fall, name='two', tags=())\n"
    )
    assert [one.name for one in scenes_of_file(path)] == ["one", "two"]
    marked = "from touchstone.scenarios.catalogue import scene\n@scene\ndef a():\n"
    for code, reason in (
        ("import nothing_like_it\n", r"mine.py:1: ModuleNotFoundError: No module named"),
        ("x = (\n", r"mine.py:1: SyntaxError: '\(' was never closed"),
        ("x = 1\n", r"mine.py: no function marked @scene"),
        (f"{marked}    return 3\n", "mine.py: scene a returns int, expected Scenario"),
        (f"{marked}    1 / 0\n", "mine.py: scene a:4: ZeroDivisionError"),
    ):
        path.write_text(code)
        with pytest.raises(SceneFileError, match=reason):
            scenes_of_file(path)


@pytest.mark.parametrize(
    ("code", "end"),
    [
        ("os._exit(0)", r"mine.py: it ends the process that reads it: exit code 0"),
        ("os.kill(os.getpid(), 9)", r"mine.py: it ends the process that reads it: signal SIGKILL"),
        ("os.abort()", r"mine.py:2: it ends the process that reads it: signal SIGABRT"),
        ("ctypes.string_at(0)", r"mine.py:2: it ends the process that reads it: signal SIGSEGV"),
        ("raise KeyboardInterrupt", r"mine.py:2: KeyboardInterrupt"),
        ("atexit.register(os._exit, 7)", r"mine.py: no function marked @scene"),
        ("os.close(1)", r"mine.py: no function marked @scene"),
    ],
)
def test_a_python_file_ends_its_own_process_alone(tmp_path, code, end):
    """A file that exits, aborts or crashes is refused by name: the program goes on."""
    path = tmp_path / "mine.py"
    path.write_text(f"import atexit, ctypes, os\n{code}\n")
    with pytest.raises(SceneFileError, match=end):
        scenes_of_file(path)


def test_a_scene_of_a_class_of_its_own_file_is_refused(tmp_path):
    """A class that only the file's process can import is named in one line."""
    path = tmp_path / "mine.py"
    path.write_text(
        "import dataclasses, sys, types\n"
        "from touchstone.scenarios.catalogue import find, scene\n"
        "from touchstone.scenarios.scenario import Scenario\n"
        "class Mine(Scenario):\n    pass\n"
        "sys.modules[__name__] = types.SimpleNamespace(Mine=Mine)\n"
        "@scene\ndef mine():\n    fall = find('fall')\n"
        "    fields = {f.name: getattr(fall, f.name) for f in dataclasses.fields(fall)}\n"
        "    return Mine(**fields | {'name': 'mine'})\n"
    )
    with pytest.raises(SceneFileError, match="cannot be sent to another process: No module"):
        scenes_of_file(path)


def test_what_a_python_file_prints_is_no_result(tmp_path, capfd):
    """Standard output is for results: that of a scene file goes to standard error."""
    path = tmp_path / "mine.py"
    path.write_text("print('loading')\n")
    with pytest.raises(SceneFileError, match="no function marked"):
        scenes_of_file(path)
    assert capfd.readouterr() == ("", "loading\n")


def test_the_schema_names_every_field():
    """The JSON Schema has all parts of a scene, with their descriptions, and refuses unknown fields."""
    schema = json_schema()
    assert {"bodies", "duration", "trackers", "limits"} <= schema["properties"].keys()
    assert schema["required"] == ["bodies", "duration", "coefficients"]
    assert all(part["additionalProperties"] is False for part in schema["$defs"].values())
    assert "kg" not in schema["$defs"]["Sphere"]["description"]
    assert "file" in schema["$defs"]["Tracker"]["properties"]


def test_a_prescribed_body_in_a_file(tmp_path):
    """It needs no mass; a coupling and two poses at one time are refused with their lines."""
    text = """duration = 1.0
coefficients = [{ material_a = "m", material_b = "m", restitution = 0.0, friction = 0.5 }]

[[bodies]]
name = "deck"
kind = "prescribed"
material = "m"
pieces = [{ name = "deck", shape = { radius = 1.0 } }]

[[trackers]]
root = "deck"
times = [0.0, 0.5, 1.0]
positions = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]]
orientations = [[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]
"""
    path = tmp_path / "deck.toml"
    path.write_text(text)
    (scene,) = scenes_of_file(path)
    assert (scene.bodies[0].mass, scene.prescribes(scene.trackers[0])) == (0.0, True)
    path.write_text(text.replace("0.5, 1.0]", "1.0, 1.0]") + "stiffness = 500.0\n")
    with pytest.raises(SceneFileError) as caught:
        scenes_of_file(path)
    twice, coupled = str(caught.value).splitlines()
    assert "deck.toml:12: trackers[0].times[2]: 'deck' has two poses at 1 s" in twice
    assert "deck.toml:15: trackers[0].stiffness: found 500.0, but 'deck' is prescribed" in coupled


FIELD = """
[[bodies]]
name = "ground"
kind = "fixed"
material = "wood"
height_field = { heights = [[0.0, 0.1], [0.0, 0.2]], spacing = [0.5, 0.5], bottom = -1.0 }
"""


def test_a_height_field_gives_a_body_its_pieces(scene):
    """Two columns per cell, in place of pieces."""
    found = scene(SOUND + FIELD)
    assert [piece.name for piece in found.bodies[1].pieces] == ["cell_0_0_a", "cell_0_0_b"]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("0.0, 0.1", "0.0, nan", "16: bodies[1].height_field.heights[0][1]: found nan, expected a finite"),
        ("[0.0, 0.2]]", "[0.0]]", "16: bodies[1].height_field.heights: found 2 rows of [1, 2] po"),
        (", [0.0, 0.2]]", "]", "16: bodies[1].height_field.heights: found 1 row"),
        ("0.5, 0.5", "0.5, -1.0", "16: bodies[1].height_field.spacing[1]: found -1.0, expected a positive"),
        ("-1.0", "0.0", "16: bodies[1].height_field.bottom: found 0.0, expected less than the lowest"),
        ('kind = "fixed"', 'kind = "simulated"\nmass = 1.0', "17: bodies[1].height_field: found on a simul"),
        (
            "height_field",
            'pieces = [{ name = "p", shape = { radius = 1.0 } }]\nheight_field',
            "17: bodies[1].height_field: found with pieces: expected one or the other",
        ),
        (FIELD.split("\n")[-2], "", "12: bodies[1].pieces: missing"),
    ],
)
def test_a_wrong_height_field_is_one_line(scene, old, new, expected):
    """Each fault names its file, its line and what is expected."""
    (fault,) = scene(SOUND + FIELD.replace(old, new))
    assert fault.startswith(f"drop.toml:{expected}")


MESH = """
[[bodies]]
name = "ground"
kind = "fixed"
material = "wood"
[bodies.mesh]
vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
triangles = [
  [0, 2, 1],
  [0, 1, 3],
  [1, 2, 3],
  [2, 0, 3],
]
"""
OBJ = """v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
f 1/1 3/1 2/1
f 1 2 4
f 2 3 4
f -2 -4 -1
"""


def test_a_mesh_gives_a_body_its_pieces(scene, tmp_path):
    """A tetrahedron per triangle, of lists, of an OBJ file, and of STL as text and binary."""
    expected = scene(SOUND + MESH).bodies[1].pieces
    assert [piece.name for piece in expected] == [f"triangle_{k}" for k in range(4)]
    corners = np.array([piece.shape.vertices[:3] for piece in expected])
    text = "".join(
        "facet normal 0 0 0\nouter loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in one) + "endloop\n"
        for one in corners
    )
    (tmp_path / "rock.obj").write_text(OBJ)
    (tmp_path / "text.stl").write_text(f"solid rock\n{text}endsolid")
    rows = b"".join(b"\0" * 12 + one.astype("<f4").tobytes() + b"\0\0" for one in corners)
    (tmp_path / "rock.stl").write_bytes(b"\0" * 80 + (4).to_bytes(4, "little") + rows)
    for name in ("rock.obj", "text.stl", "rock.stl"):
        given = MESH.partition("[bodies.mesh]")[0] + f'mesh = {{ file = "{name}" }}\n'
        assert scene(SOUND + given).bodies[1].pieces == expected


@pytest.mark.parametrize(
    ("old", "new", "line", "expected"),
    [
        ("[[0.0, 0.0, 0.0]", "[[nan, 0.0, 0.0]", 17, "vertices[0]: found (nan, 0.0, 0.0), exp"),
        ("  [0, 1, 3],\n", "", 18, "triangles: found 3, expected 4 to 8192"),
        ("[0, 1, 3]", "[0, 1, 4]", 20, "triangles[1]: found (0, 1, 4), expected three diffe"),
        ("[0, 1, 3]", "[1, 0, 3]", 19, "triangles[0]: 2 run along the edge 1-0 in one direc"),
        ("  [2, 0, 3],", "  [2, 0, 3],\n  [1, 0, 2],", 19, "triangles[0]: 3 at the edge 0-2, expected two"),
        (
            "[0.0, 0.0, 1.0]]",
            "[0.5, 0.0, 1e-4]]",
            20,
            "triangles[1]: a sliver: its height is 0.0001 m over a side of 1 m",
        ),
        ("[0.0, 0.0, 1.0]]", "[0.0, 0.0, -1.0]]", 18, "triangles: enclose -0.167 m^3, expe"),
        ("[bodies.mesh]", '[bodies.mesh]\nfile = "a.obj"', 17, "file: found with vertices, tr"),
        ("triangles =", "faces =", 18, "faces: unknown field 'faces' (valid: vertices, triangl"),
    ],
)
def test_a_wrong_mesh_names_its_place(scene, old, new, line, expected):
    """The first fault has its file, its line and what is expected."""
    fault, *_ = scene(SOUND + MESH.replace(old, new))
    assert fault.startswith(f"drop.toml:{line}: bodies[1].mesh.{expected}")


CORNER = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
SHAPED = """
[[bodies]]
name = "other"
kind = "simulated"
material = "wood"
mass = 2.0
position = [3.0, 0.0, 0.0]
pieces = [{ name = "p", shape = SHAPE }]
"""


@pytest.mark.parametrize(
    ("text", "shape", "center"),
    [
        ('{ type = "cone", radius = 0.1, half_length = 0.2 }', Cone(0.1, 0.2), (0.0, 0.0, -0.1)),
        (
            "{ half_extents = [0.1, 0.2, 0.3], radius = 0.05 }",
            RoundedBox((0.1, 0.2, 0.3), 0.05),
            (0.0, 0.0, 0.0),
        ),
        (
            "{ vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], radius = 1 }",
            RoundedHull(CORNER, 1.0),
            rounded_mass_properties(CORNER, 1.0)[1],
        ),
    ],
)
def test_cones_and_rounded_shapes_are_uniform_solids(scene, text, shape, center):
    """A cone is named by its type, a rounded shape is known by its radius; mass makes their inertia."""
    body = scene(SOUND + SHAPED.replace("SHAPE", text)).bodies[1]
    assert body.pieces[0].shape == shape
    assert body.center_of_mass == pytest.approx(center, abs=1e-8)
    assert body.inertia[0][0] > 0


@pytest.mark.parametrize("mass", [1e-300, 1e20, 1e300])
def test_a_uniform_solid_may_have_any_mass(scene, mass):
    """Its inertia is that of the solid, not of another one."""
    text = SHAPED.replace("SHAPE", "{ radius = 0.5 }").replace("mass = 2.0", f"mass = {mass}")
    assert scene(SOUND + text).bodies[1].inertia[0][0] == pytest.approx(0.1 * mass, rel=1e-12)


def test_a_half_space_is_fixed(scene):
    """It is a floor of a fixed body, and refused on one that moves."""
    plane = SHAPED.replace("SHAPE", '{ type = "half_space" }')
    still = plane.replace("simulated", "fixed").replace("mass = 2.0\n", "")
    assert scene(SOUND + still).bodies[1].pieces[0].shape == HalfSpace()
    assert any("found a half-space on a simulated body" in line for line in scene(SOUND + plane))
