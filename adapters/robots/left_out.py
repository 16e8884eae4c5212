"""What a scene does not keep of a robot, named."""

from collections import Counter
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from typing import Any

import numpy as np

from touchstone.adapters.robots.links import BALL, FREE, HINGE, UNLIMITED
from touchstone.adapters.robots.pieces import surface_velocity
from touchstone.adapters.robots.source import Source
from touchstone.scenarios.plural import plural

SECTIONS = {
    "actuator": ("actuator", ": a tracker drives the hinges"),
    "sensor": ("sensor", ""),
    "keyframe": ("keyframe", ": the robot starts in its reference posture"),
}
"""Sections of MJCF whose elements are left out: an element, and what follows its number."""
ELEMENTS = {"fixed": ("tendon", " between joints"), "skin": ("skin", ", drawn and touching nothing")}
"""Other elements of MJCF that are left out."""


def friction_of(source: Source, notes: list[str]) -> float:
    """Friction coefficient of the model's colliding geoms: where they differ, the largest; where none states
    one, MuJoCo's default; either with a note."""
    model = source.model
    active = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    found = sorted(set(model.geom_friction[active, 0].tolist())) or [1.0]
    if len(found) > 1:
        listed = ", ".join(f"{value:g}" for value in found)
        notes.append(f"friction: {listed} in the model; the largest holds for all, as MuJoCo combines them")
    elif not any("friction" in one.attributes for one in source.root.walk()):
        notes.append(
            f"friction: no shape states one; {found[0]:g} holds for all, as in MuJoCo, restitution 0"
        )
    return float(found[-1])


def left_out(source: Source, kept: AbstractSet[str] | None) -> list[str]:
    """A line per kind of thing that is not in the scene; `kept`: names of the hinges of driven bodies, None
    for a simulated robot, which keeps springs, damping, actuators and exclusions; `couplings.py` has its
    couplings of joints."""
    model, notes, driven = source.model, [], kept is not None
    for section, (word, text) in SECTIONS.items():
        if section == "actuator" and not driven:
            continue
        several = [
            one for element in source.root.walk() if element.tag == section for one in element.children
        ]
        if source.form == "mjcf" and several:
            notes.append(f"left out: {plural(len(several), word)}{text}")
    equalities = [
        one for element in source.root.walk() if element.tag == "equality" for one in element.children
    ]
    mimics = [
        one
        for one in source.root.walk()
        if one.tag == "joint" and any(child.tag == "mimic" for child in one.children)
    ]
    if not driven:
        equalities, mimics = [one for one in equalities if one.tag != "joint"], []
    for coupled in (*equalities, *mimics):
        name = coupled.attributes.get("joint1") or coupled.attributes.get("name") or coupled.tag
        notes.append(f"left out: the coupling of joint {name!r}")
    for tag, (word, text) in ELEMENTS.items():
        if count := sum(one.tag == tag for one in source.root.walk()):
            notes.append(f"left out: {plural(count, word)}{text}")
    hinges = np.flatnonzero(model.jnt_type == HINGE if driven else model.jnt_type != FREE)
    dofs = model.jnt_dofadr[hinges]
    counts = Counter(
        {
            "springs": _count(model.jnt_stiffness[hinges]) if driven else _unkept_springs(model),
            "damping": _count(model.dof_damping[dofs]) if driven else _unkept_damping(model),
            "dry friction": _count(model.dof_frictionloss[dofs]),
            "rotor inertia (armature)": _count(model.dof_armature[dofs]),
        }
    )
    of = "hinge" if driven else "joint"
    notes += [f"left out: {what} of {plural(count, of)}" for what, count in counts.items() if count]
    if not driven and model.body_gravcomp.any():
        held = plural(int(np.count_nonzero(model.body_gravcomp)), "body")
        notes.append(f"left out: compensation of gravity of {held}")
    if not driven and (model.opt.density or model.opt.viscosity):
        notes.append("left out: the fluid that bodies move in")
    drawn = int(np.count_nonzero((model.geom_contype == 0) & (model.geom_conaffinity == 0)))
    if drawn:
        notes.append(f"left out: {plural(drawn, 'geom')}, drawn and touching nothing")
    moving = np.flatnonzero(getattr(model, "geom_surfacevel", np.zeros((model.ngeom, 6))).any(axis=1))
    if dropped := [geom for geom in moving if not surface_velocity(model, int(geom)).any()]:
        notes.append(f"left out: moving surfaces of {plural(len(dropped), 'geom')} of bodies that can move")
    if model.npair or (model.nexclude and driven):
        and_exclusions = f" and {plural(model.nexclude, 'exclusion')}" if driven else ""
        notes.append(f"left out: {plural(model.npair, 'pair')}{and_exclusions} of contact")
    if kept is None:
        return notes
    bounded = {
        one.attributes.get("name") for one in source.root.walk() if one.attributes.get("type") == "revolute"
    }
    free = [model.joint(joint).name for joint in hinges if not model.jnt_limited[joint]]
    for text, found in (
        ("without limits", [name for name in free if name in kept - bounded]),
        ("limits equal or missing", [name for name in free if name in kept & bounded]),
    ):
        if found:
            joints = listed("joint", found)
            notes.append(f"{joints}: {text}; the scene has {UNLIMITED:g} rad, which stops nothing")
    return notes


def listed(word: str, names: Sequence[str]) -> str:
    """Things of a kind by name, of more than five the first: "joints 'a', 'b'"."""
    more = f" and {len(names) - 5} more" if names[5:] else ""
    return f"{word}{'s' if names[1:] else ''} {', '.join(map(repr, names[:5]))}{more}"


def _unkept_springs(model: Any) -> int:
    """Springs of ball and free joints, and those whose force is not linear."""
    several = (model.jnt_type == FREE) | (model.jnt_type == BALL)
    bent = getattr(model, "jnt_stiffnesspoly", np.zeros((model.njnt, 1))).any(axis=1)
    return int(np.count_nonzero(bent | (several & model.jnt_stiffness.astype(bool))))


def _unkept_damping(model: Any) -> int:
    """Free joints with damping, and joints whose damping is not linear."""
    bent = getattr(model, "dof_dampingpoly", np.zeros((model.nv, 1))).any(axis=1)
    free = np.isin(model.dof_jntid, np.flatnonzero(model.jnt_type == FREE))
    return len(set(model.dof_jntid[bent | (free & model.dof_damping.astype(bool))].tolist()))


def _count(values: np.ndarray) -> int:
    """Number of joints with a coefficient other than 0; polynomials have several."""
    return int(np.count_nonzero(values.reshape(len(values), -1 if len(values) else 1).any(axis=1)))
