"""MuJoCo scripts: the adapter's spec as MJCF, with all digits, and the numbers that drive its bodies.

`MjSpec.to_xml` writes six digits. Attributes that most geoms share become their default: the lines that set
settings are `<compiler>`, `<option>` and `<default>`.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

from touchstone.adapters.contract import Array, Settings, Unsupported
from touchstone.adapters.engines.mujoco.engine import MujocoEngine, World, translated
from touchstone.adapters.engines.mujoco.settings import SETTINGS
from touchstone.adapters.knobs import Choice
from touchstone.adapters.scripts.script import Parts, literal, moving, within
from touchstone.scenarios.scenario import Scenario

Attributes = dict[str, str]
UNWRITTEN = frozenset(
    ("id", "info", "parent", "frame", "signature", "classname", "compiler", "alt", "plugin", "userdata")
)
"""Fields of every element that are no attribute."""
ELSEWHERE = {
    "body": ("explicitinertial", "mass", "ipos", "iquat", "inertia", "fullinertia", "ialt"),
    "joint": ("type", "align"),
    "mesh": ("uservert",),
}
"""Fields that are written elsewhere, or that follow from the element."""
RENAMED = {
    ("geom", "meshname"): "mesh",
    ("geom", "hfieldname"): "hfield",
    ("pair", "geomname1"): "geom1",
    ("pair", "geomname2"): "geom2",
    ("exclude", "bodyname1"): "body1",
    ("exclude", "bodyname2"): "body2",
    ("compiler", "degree"): "angle",
    ("joint", "solref_limit"): "solreflimit",
    ("joint", "solimp_limit"): "solimplimit",
    ("joint", "solref_friction"): "solreffriction",
    ("joint", "solimp_friction"): "solimpfriction",
}
WORDS: dict[str, type] = {
    "jacobian": mujoco.mjtJacobian,
    "type": mujoco.mjtGeom,
    "inertia": mujoco.mjtMeshInertia,
    "limited": mujoco.mjtLimited,
    "inertiafromgeom": mujoco.mjtInertiaFromGeom,
}
"""Fields with named values, beside those of the table of settings."""
FIRST = ("name", "type", "size", "pos", "quat", "timestep", "integrator")
"""Attributes that come first."""
FLAGS = (
    ("disableflags", mujoco.mjtDisableBit, "mjDSBL_", "disable"),
    ("enableflags", mujoco.mjtEnableBit, "mjENBL_", "enable"),
)
OF_CONTACTS = (
    "condim",
    "priority",
    "friction",
    "solmix",
    "solref",
    "solimp",
    "margin",
    "gap",
    "solreffriction",
)
"""Attributes of geoms and pairs that become defaults where most have them."""


def parts(scenario: Scenario, settings: Settings) -> Parts:
    """The parts of a scene's script.

    Raises:
        Unsupported: MuJoCo cannot represent the scene, or a setting has no words here.
    """
    world = MujocoEngine().build(scenario, settings)
    model, data = world._model, world._data
    spec, _, _ = translated(scenario, settings)
    document = _Document(spec, scenario)
    xml = document.lines()
    scene = [*xml, "model = mujoco.MjModel.from_xml_string(xml)", "data = mujoco.MjData(model)"]
    fresh = mujoco.MjData(model)
    for name in ("qpos", "qvel"):
        if not np.array_equal(getattr(data, name), getattr(fresh, name)):
            scene.append(f"data.{name}[:] = {literal(getattr(data, name))}")
    names = {scenario.bodies[k].name: literal(scenario.bodies[k].name) for k in moving(scenario)}
    commands, step = _commands(world, scenario, settings)
    packing = ["import base64", "import zlib"] if commands is not None else []
    return Parts(
        f"mujoco=={mujoco.__version__}",
        [*packing, "import mujoco", *(["import numpy as np"] if commands is not None else [])],
        document.settings(),
        lambda width: scene,
        [*step, "mujoco.mj_step(model, data)"],
        names,
        "data.body(body).xpos.tolist()",
        ["mujoco.mj_kinematics(model, data)  # positions lag behind by a step without it"],
        commands,
    )


def settings_lines(scenario: Scenario, settings: Settings) -> list[str]:
    """MJCF that sets the settings in a scene."""
    return _Document(translated(scenario, settings)[0], scenario).settings_xml()


class _Document:
    """MJCF of a spec."""

    def __init__(self, spec: Any, scenario: Scenario) -> None:
        self._spec, self._names = spec, {f"{k}": body.name for k, body in enumerate(scenario.bodies)}
        geoms = [self._attributes("geom", one) for one in spec.geoms]
        pairs = [self._attributes("pair", one) for one in spec.pairs]
        self._shared = {"geom": _shared(geoms), "pair": _shared(pairs)}

    def settings_xml(self) -> list[str]:
        """Elements that hold the settings, one a line."""
        option = self._attributes("option", self._spec.option, ("disableflags", "enableflags"))
        flags: Attributes = {}
        for field, bits, prefix, word in FLAGS:
            for name, bit in bits.__members__.items():
                if getattr(self._spec.option, field) & int(bit) and name.startswith(prefix):
                    flags[name.removeprefix(prefix).lower()] = word
        defaults = [_element(kind, shared) for kind, shared in self._shared.items() if shared]
        return [
            _element("compiler", self._attributes("compiler", self._spec.compiler)),
            _element("option", option, [_element("flag", flags)] if flags else []),
            *([_element("default", {}, defaults)] if defaults else []),
        ]

    def settings(self) -> list[str]:
        """The start of the document in the script."""
        return ['xml = """<mujoco>', *map(within, self.settings_xml())]

    def lines(self) -> list[str]:
        spec = self._spec
        meshes = [
            _element("mesh", self._named("mesh", m) | {"vertex": _numbers(m.uservert)}) for m in spec.meshes
        ]
        contact = [self._plain("pair", one) for one in spec.pairs]
        contact += [self._plain("exclude", one) for one in spec.excludes]
        servos = [_servo(one) for one in spec.actuators]
        groups = (("asset", meshes), ("contact", contact), ("actuator", servos))
        bodies = [self._body(body) for body in spec.worldbody.bodies]
        found = ["<worldbody>", *bodies, "</worldbody>"]
        for name, elements in groups:
            found += [f"<{name}>", *elements, f"</{name}>"] if elements else []
        return [*map(within, _few(found)), '</mujoco>"""']

    def _body(self, body: Any) -> str:
        inner = [self._joint(joint) for joint in body.joints]
        if body.explicitinertial:
            inner.append(_element("inertial", _inertial(body)))
        inner += [self._plain("geom", geom) for geom in body.geoms]
        inner += [self._body(child) for child in body.bodies]
        return _element("body", self._named("body", body), inner)

    def _joint(self, joint: Any) -> str:
        free = joint.type == mujoco.mjtJoint.mjJNT_FREE
        return _element("freejoint" if free else "joint", self._named("joint", joint))

    def _plain(self, kind: str, one: Any) -> str:
        found, shared = self._named(kind, one), self._shared.get(kind, {})
        back = {name: _value(name, getattr(_DEFAULTS[kind](), name)) for name in shared if name not in found}
        return _element(kind, {k: v for k, v in (found | back).items() if shared.get(k) != v})

    def _named(self, kind: str, one: Any) -> Attributes:
        found = self._attributes(kind, one)
        for key in ("name", "mesh", "geom1", "geom2", "body1", "body2"):
            if key in found and kind != "joint":
                body, dot, piece = found[key].partition(".")
                found[key] = self._names.get(body, body) + dot + piece
        return found

    def _attributes(self, kind: str, one: Any, skipped: Iterable[str] = ()) -> Attributes:
        """Attributes of an element that differ from MuJoCo's defaults."""
        plain, found = _DEFAULTS[kind](), {}
        for field in dir(one):
            if (
                field.startswith("_")
                or field in UNWRITTEN
                or field in ELSEWHERE.get(kind, ())
                or field in skipped
            ):
                continue
            value, default = getattr(one, field), getattr(plain, field)
            if callable(value) or _is_list(value) or _equal(value, default):
                continue
            found[RENAMED.get((kind, field), field)] = _value(field, value)
        return found


_DEFAULTS: Mapping[str, Callable[[], Any]] = {
    "option": lambda: mujoco.MjSpec().option,
    "compiler": lambda: mujoco.MjSpec().compiler,
    "body": lambda: mujoco.MjSpec().worldbody.add_body(),
    "geom": lambda: mujoco.MjSpec().worldbody.add_body().add_geom(),
    "joint": lambda: mujoco.MjSpec().worldbody.add_body().add_joint(),
    "mesh": lambda: mujoco.MjSpec().add_mesh(),
    "pair": lambda: mujoco.MjSpec().add_pair(),
    "exclude": lambda: mujoco.MjSpec().add_exclude(),
}
"""New elements, with MuJoCo's defaults."""


def _is_list(value: Any) -> bool:
    return isinstance(value, (list, tuple)) and any(hasattr(one, "signature") for one in value)


def _equal(value: Any, default: Any) -> bool:
    """Whether two values are equal, number by number; not a number equals itself."""
    one, other = np.asarray(value), np.asarray(default)
    return np.array_equal(one, other, equal_nan=one.dtype.kind == "f")


def _value(field: str, value: Any) -> str:
    if field == "degree":
        return "degree" if value else "radian"
    if isinstance(choice := SETTINGS.get(field), Choice):
        return choice.word(value)
    if field in WORDS:
        return str(WORDS[field](value).name.split("_")[-1].lower())
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    return _numbers(value)


def _numbers(values: Any) -> str:
    """Numbers with all digits; zeros at the end of parameters stay."""
    return " ".join(repr(float(value)).removesuffix(".0") for value in np.ravel(values))


def _inertial(body: Any) -> Attributes:
    found = {"pos": _numbers(body.ipos), "mass": _numbers(body.mass)}
    if np.isfinite(body.fullinertia).all() and np.any(body.fullinertia):
        return found | {"fullinertia": _numbers(body.fullinertia)}
    return found | {"diaginertia": _numbers(body.inertia)}


def _servo(actuator: Any) -> str:
    """A position actuator of a hinge, whose gain says all."""
    stiffness, bias = actuator.gainprm[0], actuator.biasprm
    if bias[1] != -stiffness or np.count_nonzero(bias) > 1:
        raise Unsupported(f"mujoco: no words for the actuator {actuator.name!r}, which is no position servo")
    names = {"name": actuator.name, "joint": actuator.target}
    return _element("position", names | {"kp": _numbers(stiffness)})


def _shared(elements: list[Attributes]) -> Attributes:
    """Attributes of contacts that most elements have."""
    found = {}
    for name in OF_CONTACTS:
        counts = Counter(one.get(name, "") for one in elements)
        if counts and (most := max(counts, key=lambda value: (counts[value], value))):
            found[name] = most
    return found


def _element(name: str, attributes: Attributes, inner: Iterable[str] = ()) -> str:
    order = sorted(attributes, key=lambda key: FIRST.index(key) if key in FIRST else len(FIRST))
    text = "".join(f" {key}={quoteattr(attributes[key])}" for key in order)
    below = "".join(inner)
    return f"<{name}{text}>{below}</{name}>" if below else f"<{name}{text}/>"


MOST_ELEMENTS = 26
"""Lines of MJCF; beyond them, elements share lines."""


def _few(elements: list[str]) -> list[str]:
    """Elements on at most MOST_ELEMENTS lines."""
    each = -(-len(elements) // MOST_ELEMENTS)
    return ["".join(elements[k : k + each]) for k in range(0, len(elements), each)]


def _commands(world: World, scenario: Scenario, settings: Settings) -> tuple[Array | None, list[str]]:
    """Numbers that the adapter writes before each step, (s, n), and the lines that write them."""
    if not scenario.trackers:
        return None, []
    data, steps = world._data, round(scenario.duration / settings.dt)
    fields = ("qpos", "qvel", "qfrc_applied", "ctrl", "mocap_pos", "mocap_quat")
    written: list[Array] = []
    touched = {name: np.zeros(getattr(data, name).size, bool) for name in fields}
    for step in range(steps):
        before = {name: getattr(data, name).ravel().copy() for name in fields}
        world.drive(step)
        after = {name: getattr(data, name).ravel() for name in fields}
        for name in fields:
            own = name in ("qpos", "qvel")  # the state itself changes by steps too
            touched[name] |= after[name] != (before[name] if own else 0.0)
        written.append(np.concatenate([after[name] for name in fields]))
        mujoco.mj_step(world._model, data)
    columns = {name: np.flatnonzero(mask) for name, mask in touched.items() if mask.any()}
    offsets = dict(zip(fields, np.cumsum([0, *(touched[name].size for name in fields)])))
    kept = np.concatenate([offsets[name] + columns[name] for name in columns])
    lines, first = [], 0
    for name, places in columns.items():
        flat = f"data.{name}.reshape(-1)" if name.startswith("mocap") else f"data.{name}"
        lines.append(f"{flat}[{_places(places)}] = row[{first}:{first + len(places)}]")
        first += len(places)
    return np.array(written)[:, kept], lines


def _places(places: np.ndarray) -> str:
    """Indices as a slice where they follow one another."""
    first, last = int(places[0]), int(places[-1])
    return f"{first}:{last + 1}" if last - first + 1 == len(places) else literal(places)
