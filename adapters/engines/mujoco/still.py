"""A picture of one moment of a recording, drawn by MuJoCo's renderer without a display.

Bodies are posed as recorded; nothing is simulated. Fixed bodies between the camera and its target are
left out.
"""

import os
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.contract import AdapterError, Array
from touchstone.scenarios.avatar.kinematics import matrix, piece_box
from touchstone.scenarios.scenario import Body, Box, Piece, Scenario

WIDTH, HEIGHT = 960, 600
SAMPLES = 8
"""Samples of a pixel against jagged edges."""
SHADED = 0.7
"""Half the width of what has shadows, over the camera's distance [1]: their texels are a share of it."""
LAMP = 2.5
"""Height of the lamp over the camera, over the camera's distance [1]."""
FIELD_OF_VIEW = 45.0
"""Vertical angle of the camera [degrees]."""
COLORS = {
    "floor": (0.82, 0.81, 0.78, 1.0),
    "fixed": (0.70, 0.72, 0.74, 1.0),
    "driven": (0.84, 0.55, 0.40, 1.0),
    "prescribed": (0.60, 0.52, 0.72, 1.0),
    "simulated": (0.16, 0.42, 0.66, 1.0),
}
"""Colours by the kind of body [red, green, blue, alpha]."""


class View(NamedTuple):
    """The camera: its target [m], its distance from it [m], and its direction [degrees]."""

    center: tuple[float, float, float]
    distance: float
    azimuth: float = 60.0
    elevation: float = -18.0

    @property
    def eye(self) -> Array:
        """Place of the camera [m]."""
        a, e = np.radians((self.azimuth, self.elevation))
        ahead = np.array((np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)))
        return np.array(self.center) - self.distance * ahead


def still(scenario: Scenario, position: Array, orientation: Array, view: View) -> NDArray[np.uint8]:
    """Draw a scene whose n bodies are posed by `position` (n, 3) [m] and `orientation` (n, 4) wxyz.

    Returns:
        Picture (HEIGHT, WIDTH, 3).
    Raises:
        AdapterError: this machine has no way to draw without a display.
    """
    os.environ.setdefault("MUJOCO_GL", "egl")
    import mujoco

    spec = _spec(mujoco, scenario, position, orientation, view)
    model = spec.compile()
    model.vis.map.shadowclip = SHADED * view.distance / model.stat.extent
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat, camera.distance = view.center, view.distance
    camera.azimuth, camera.elevation = view.azimuth, view.elevation
    try:
        with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
            renderer.update_scene(data, camera)
            return renderer.render().copy()
    except Exception as error:  # each way to draw has errors of its own
        raise AdapterError(f"mujoco cannot draw without a display here: {error}") from error


def _spec(mujoco: Any, scenario: Scenario, position: Array, orientation: Array, view: View) -> Any:
    """Bodies at their recorded poses, lights, and a camera."""
    from touchstone.adapters.engines.mujoco.model import add_piece

    spec = mujoco.MjSpec()
    spec.visual.global_.offwidth, spec.visual.global_.offheight = WIDTH, HEIGHT
    spec.visual.global_.fovy = FIELD_OF_VIEW
    spec.visual.quality.offsamples, spec.visual.quality.shadowsize = SAMPLES, 8192
    spec.visual.map.znear, spec.visual.headlight.ambient = 0.005, (0.45, 0.45, 0.45)
    spec.visual.headlight.diffuse, spec.visual.headlight.specular = (0.3, 0.3, 0.3), (0.0, 0.0, 0.0)
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.95, 0.96, 0.98),
        rgb2=(0.80, 0.84, 0.90),
        width=64,
        height=64,
    )
    lamp = view.eye + (0.0, 0.0, LAMP * view.distance)
    spec.worldbody.add_light(
        pos=lamp,
        dir=np.array(view.center) - lamp,
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        diffuse=(0.45, 0.45, 0.45),
        specular=(0.1, 0.1, 0.1),
        castshadow=True,
    )
    for index, body in enumerate(scenario.bodies):
        own = spec.worldbody.add_body(
            name=f"{index}", pos=position[index], quat=orientation[index] / np.linalg.norm(orientation[index])
        )
        hidden = body.kind == "fixed" and any(_hides(body, piece, view) for piece in body.pieces)
        for k, piece in enumerate(() if hidden else body.pieces):
            add_piece(spec, own, piece, f"{index}.{k}")
            own.geoms[-1].rgba = COLORS["floor" if _is_floor(body, piece) else body.kind]
    return spec


def _is_floor(body: Body, piece: Piece) -> bool:
    """Whether a fixed box is wide and lies below everything."""
    return body.kind == "fixed" and isinstance(piece.shape, Box) and min(piece.shape.half_extents[:2]) > 2


def _hides(body: Body, piece: Piece, view: View) -> bool:
    """Whether a fixed piece's box about its corners meets the line from the camera to its target."""
    low, high = piece_box(piece, np.array(body.position), matrix(body.orientation))
    start, way = view.eye, np.array(view.center) - view.eye
    with np.errstate(divide="ignore"):
        first, second = (low - start) / way, (high - start) / way
    enters, leaves = np.minimum(first, second).max(), np.maximum(first, second).min()
    return bool(max(enters, 0.0) < min(leaves, 0.9))
