"""Recordings that someone has forged, each in one way: a field's arrays or texts, or the archive."""

import io
import json
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

Columns = dict[str, np.ndarray]
Change = Callable[[Columns], object]


def _json(field: str, change: Callable[[dict], object]) -> Change:
    def forge(columns: Columns) -> None:
        data = json.loads(str(columns[field]))
        change(data)
        columns[field] = np.array(json.dumps(data))

    return forge


def _set(**values: object) -> Change:
    return lambda columns: columns.update({name: np.asarray(value) for name, value in values.items()})


def _cut(field: str) -> Change:
    return lambda columns: columns.update({field: columns[field][..., :-1]})


def _cast(field: str, kind: object) -> Change:
    return lambda columns: columns.update({field: columns[field].astype(kind)})


def _contact(**values: object) -> Change:
    def forge(columns: Columns) -> None:
        rows = np.zeros(1, columns["contacts"].dtype)
        for name, value in values.items():
            rows[name] = value
        columns["contacts"] = rows

    return forge


ARRAYS = (
    "time",
    "position",
    "orientation",
    "joint_angle",
    "driver_work",
    "driver_impulse",
    "time_frame",
    "work",
)
CHANGES: Mapping[str, tuple[str, Change]] = {
    **{
        f"no {name}": (name, lambda columns, name=name: columns.pop(name))
        for name in ("scenario", "contacts", "work")
    },
    **{
        f"{name}: texts": (name, lambda columns, name=name: columns.update({name: np.array(["a"])}))
        for name in ARRAYS
    },
    **{
        f"{name}: a number": (name, _set(**{name: 1.0}))
        for name in (*ARRAYS, "contacts", "stage_names", "ended")
    },
    "position: single": ("position", _cast("position", "f4")),
    "position: complex": ("position", _cast("position", "c16")),
    "position: objects": ("position", _cast("position", object)),
    "time: whole numbers": ("time", _cast("time", int)),
    "stage_names: bytes": ("stage_names", _set(stage_names=np.array([b"a"]))),
    "contacts: plain": ("contacts", _set(contacts=np.zeros((3, 25)))),
    "position: a row less": ("position", lambda columns: columns.update(position=columns["position"][1:])),
    "position: two coordinates": ("position", _cut("position")),
    "position: a body less": (
        "position",
        lambda columns: columns.update(position=columns["position"][:, 1:]),
    ),
    "orientation: vectors": ("orientation", _cut("orientation")),
    "joint_angle: one more": ("joint_angle", lambda c: c.update(joint_angle=np.zeros((len(c["time"]), 9)))),
    "stage_seconds: a stage more": (
        "stage_seconds",
        lambda c: c.update(stage_seconds=np.zeros((len(c["time"]) - 1, 99))),
    ),
    "time_frame: a frame less": ("time_frame", _cut("time_frame")),
    "time: empty": ("time", _set(time=np.zeros(0))),
    "time: NaN": ("time", lambda columns: columns["time"].__setitem__(1, np.nan)),
    "time: infinite": ("time", lambda columns: columns["time"].__setitem__(-1, np.inf)),
    "time: backwards": ("time", lambda columns: columns.update(time=columns["time"][::-1].copy())),
    "position: not finite": ("position", lambda columns: columns["position"].fill(np.nan)),
    "orientation: not finite": ("orientation", lambda columns: columns["orientation"].fill(np.inf)),
    "work: not finite": ("work", lambda columns: columns["work"].fill(np.nan)),
    "position: too far": ("position", lambda columns: columns["position"].__setitem__(-1, 1e308)),
    "angular_velocity: too fast": (
        "angular_velocity",
        lambda columns: columns["angular_velocity"].__setitem__(-1, 1e39),
    ),
    "driver_work: infinite": ("driver_work", lambda columns: columns["driver_work"].fill(np.inf)),
    "time_frame: negative": ("time_frame", lambda columns: columns["time_frame"].fill(-1)),
    "time: far apart": ("time", lambda columns: columns["time"].__imul__(1e300)),
    "time: at once": ("time", lambda columns: columns["time"].__imul__(1e-300)),
    "time: later": ("time", lambda columns: columns["time"].__iadd__(1e9)),
    "time: longer than the scene": ("time", lambda c: c.update(time=np.arange(9999) / 60)),
    "contacts: before the run": ("contacts", _contact(time=-1)),
    "contacts: at no time": ("contacts", _contact(time=np.nan)),
    "contacts: after the run": ("contacts", _contact(time=1e308)),
    "contacts: nowhere": ("contacts", _contact(position=np.nan)),
    "contacts: far away": ("contacts", _contact(distance=-1e308)),
    "contacts: an infinite impulse": ("contacts", _contact(impulse=np.inf)),
    "contacts: a body too many": ("contacts", _contact(body_b=10**6)),
    "contacts: a body below 0": ("contacts", _contact(body_a=-1)),
    "format_version: a text": ("format version", _set(format_version="three")),
    "format_version: several": ("format version", _set(format_version=[3, 3])),
    "format_version: NaN": ("format version", _set(format_version=np.nan)),
    "scenario: empty": ("scenario", _set(scenario="")),
    "scenario: a list": ("scenario", _set(scenario="[1, 2]")),
    "scenario: deep": ("scenario", _set(scenario="[" * 100_000)),
    "scenario: no bodies": ("scenario", _json("scenario", lambda data: data.pop("bodies"))),
    "scenario: a body less": ("scenario", _json("scenario", lambda data: data["bodies"].pop())),
    "scenario: bodies are texts": (
        "scenario",
        _json("scenario", lambda data: data.update(bodies=["a", "b"])),
    ),
    "scenario: a mass is a text": (
        "scenario",
        _json("scenario", lambda data: data["bodies"][0].update(mass="1")),
    ),
    "scenario: a mass is NaN": (
        "scenario",
        _json("scenario", lambda data: data["bodies"][-1].update(mass=float("nan"), kind="simulated")),
    ),
    "scenario: another body": (
        "scenario",
        _json("scenario", lambda data: data["bodies"][-1].update(name="other")),
    ),
    "scenario: an unknown field": ("scenario", _json("scenario", lambda data: data.update(more=1))),
    "scenario: another folder": (
        "scenario",
        _json("scenario", lambda data: data.update(name="../../elsewhere")),
    ),
    "scenario: no frame rate": ("scenario", _json("scenario", lambda data: data.update(frame_rate=0))),
    "manifest: no JSON": ("manifest", _set(manifest="{")),
    "manifest: a list": ("manifest", _set(manifest="[]")),
    "manifest: no engine": ("manifest", _json("manifest", lambda data: data.pop("engine"))),
    "manifest: no profile": ("manifest", _json("manifest", lambda data: data.pop("profile"))),
    "manifest: a step of 0": ("manifest", _json("manifest", lambda data: data.update(dt=0))),
    "manifest: a step is a text": ("manifest", _json("manifest", lambda data: data.update(dt="1/60"))),
    "manifest: a step is NaN": ("manifest", _json("manifest", lambda data: data.update(dt=float("nan")))),
    "manifest: a step beyond numbers": ("manifest", _json("manifest", lambda data: data.update(dt=10**400))),
    "manifest: half a character": ("manifest", _json("manifest", lambda data: data.update(engine="\ud800"))),
    "manifest: an effect is a number": (
        "manifest",
        _json("manifest", lambda data: data["effects"].update(contact=1)),
    ),
    "manifest: another body": ("manifest", _json("manifest", lambda data: data["bodies"].update(other={}))),
    "manifest: effects are a list": ("manifest", _json("manifest", lambda data: data.update(effects=[1]))),
    "scenario: half a character": ("scenario", _json("scenario", lambda data: data.update(summary="\ud800"))),
    "scenario: endless": ("scenario", _json("scenario", lambda data: data.update(duration=1e308))),
    "stage_names: half a character": (
        "stage_names",
        lambda columns: columns.update(stage_names=np.full_like(columns["stage_names"], "\ud800")),
    ),
    "ended: half a character": ("ended", _set(ended="\ud800")),
    "ended: several": ("ended", _set(ended=["a", "b"])),
}
"""Way to forge -> what the message names, and the change of the arrays."""


def _claiming(shape: str) -> Callable[[Path], None]:
    """Let `position` claim a shape that the file does not hold."""

    def forge(path: Path) -> None:
        head = io.BytesIO()
        np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (1,)})
        text = (
            head.getvalue().replace(b"(1,)", shape.encode()).replace(b" " * (len(shape) - 4) + b"\n", b"\n")
        )
        _rewritten(path, {"position.npy": text + bytes(64)})

    return forge


def _rewritten(path: Path, members: Mapping[str, bytes]) -> None:
    with zipfile.ZipFile(path) as archive:
        kept = {name: archive.read(name) for name in archive.namelist()} | members
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in kept.items():
            archive.writestr(name, data)


FILES: Mapping[str, tuple[str, Callable[[Path], None]]] = {
    "a huge shape": ("position", _claiming("(99999999999999,)")),
    "a shape beyond integers": ("position", _claiming(f"({10**30},)")),
    "a negative shape": ("position", _claiming("(-5,)")),
    "no array": ("position", lambda path: _rewritten(path, {"position.npy": b"no array"})),
    "half a file": (
        "",
        lambda path: path.write_bytes(path.read_bytes()[: path.stat().st_size // 2]) and None,
    ),
    "an empty archive": ("", lambda path: zipfile.ZipFile(path, "w").close()),
    "a bare array": ("", lambda path: path.write_bytes(b"\x93NUMPY\x01\x00") and None),
}
"""Way to forge a file -> what the message names, and the change of the file."""
WAYS = (*CHANGES, *FILES)


def forge(path: Path, way: str) -> str:
    """Forge a recording in one way; returns what a message names."""
    if way in FILES:
        named, change_file = FILES[way]
        change_file(path)
        return named
    named, change = CHANGES[way]
    rewrite(path, change)
    return named


def rewrite(path: Path, change: Change) -> None:
    """Change the arrays of a file."""
    with np.load(path) as archive:
        columns = {name: archive[name].copy() for name in archive.files}
    change(columns)
    np.savez_compressed(path, **columns)  # type: ignore[arg-type]
