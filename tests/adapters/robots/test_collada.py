"""Collada meshes of a URDF: with their units, as hulls, and refused where they hold nothing."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("mujoco", reason="not installed (pip install mujoco)")
pytest.importorskip("coal", reason="not installed (pip install coal)")

from touchstone.adapters.robots.robot_error import RobotError
from touchstone.adapters.robots.robot_scene import imported

TETRAHEDRON = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset><created>2026-01-01</created><modified>2026-01-01</modified>
  <unit meter="0.01" name="centimeter"/><up_axis>Z_UP</up_axis></asset>
 <library_geometries><geometry id="g" name="g"><mesh>
  <source id="p"><float_array id="pa" count="12">0 0 0 10 0 0 0 20 0 0 0 30</float_array><technique_common>
   <accessor source="#pa" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
    <param name="Z" type="float"/></accessor></technique_common></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>
   <p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles>
 </mesh></geometry></library_geometries>
 <library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node></visual_scene>
 </library_visual_scenes><scene><instance_visual_scene url="#s"/></scene>
</COLLADA>"""
INERTIAL = '<inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
ROBOT = f"""<robot name="r"><link name="cube">{INERTIAL}
<collision><geometry><mesh filename="part.dae"/></geometry></collision></link></robot>"""


def test_a_collada_mesh_is_a_hull_in_metres(tmp_path):
    """A tetrahedron of 10, 20 and 30 cm has its corners, in m, and its upward axis."""
    (tmp_path / "part.dae").write_text(TETRAHEDRON)
    (tmp_path / "r.urdf").write_text(ROBOT)
    found = imported(tmp_path / "r.urdf", "robot")
    (piece,) = next(body for body in found.scenario.bodies if body.name == "cube").pieces
    turned = Rotation.from_quat(piece.orientation, scalar_first=True)
    corners = turned.apply(piece.shape.vertices) + piece.position
    wanted = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]])
    assert all(np.abs(corners - one).max(axis=1).min() < 1e-7 for one in wanted)  # MuJoCo stores float32


@pytest.mark.parametrize(
    "text", ["", "<COLLADA/>", TETRAHEDRON.replace("<p>0 2 1 0 1 3 0 3 2 1 2 3</p>", "<p/>")]
)
def test_a_mesh_that_holds_nothing_is_refused(tmp_path, text):
    """File, line, element, and the mesh's name."""
    (tmp_path / "part.dae").write_text(text)
    (tmp_path / "r.urdf").write_text(ROBOT)
    with pytest.raises(RobotError, match=r"r\.urdf:2: mesh: part\.dae: "):
        imported(tmp_path / "r.urdf", "robot")
