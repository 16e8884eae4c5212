"""What a scene does not keep of a robot, named."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from typing import Any

import numpy as np

from touchstone.adapters.robots.links import HINGE, UNLIMITED
from touchstone.adapters.robots.pieces import surface_velocity
from touchstone.adapters.robots.source import Source

SECTIONS = {
    "actuator": "actuators: a tracker drives the hinges",
    "sensor": "sensors",
    "keyframe": "keyframes: the robot starts in its reference posture",
}
"""Sections of MJCF whose elements are left out."""


def friction_of(model: Any, notes: list[str]) -> float:
    """Friction coefficient of the model's colliding geoms; where they differ, the largest, with a note."""
    active = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    found = sorted(set(model.geom_friction[active, 0].tolist()))
    if len(found) > 1:
        listed = ", ".join(f"{value:g}" for value in found)
        notes.append(f"friction: {listed} in the model; the largest holds for all, as MuJoCo combines them")
    return float(found[-1]) if found else 1.0


def left_out(source: Source, kept: Collection[str]) -> list[str]:
    """A line per kind of thing that is not in the scene; `kept`: names of its joints."""
    model, notes = source.model, []
    for section, text in SECTIONS.items():
        several = [
            one for element in source.root.walk() if element.tag == section for one in element.children
        ]
        if source.form == "mjcf" and several:
            notes.append(f"left out: {len(several)} {text}")
    equalities = [
        one for element in source.root.walk() if element.tag == "equality" for one in element.children
    ]
    mimics = [
        one
        for one in source.root.walk()
        if one.tag == "joint" and any(child.tag == "mimic" for child in one.children)
    ]
    for coupled in (*equalities, *mimics):
        name = coupled.attributes.get("joint1") or coupled.attributes.get("name") or coupled.tag
        notes.append(f"left out: the coupling of joint {name!r}")
    hinges = np.flatnonzero(model.jnt_type == HINGE)
    dofs = model.jnt_dofadr[hinges]
    counts = Counter(
        {
            "springs": _count(model.jnt_stiffness[hinges]),
            "damping": _count(model.dof_damping[dofs]),
            "dry friction": _count(model.dof_frictionloss[dofs]),
            "rotor inertia (armature)": _count(model.dof_armature[dofs]),
        }
    )
    notes += [f"left out: {what} of {count} hinges" for what, count in counts.items() if count]
    drawn = int(np.count_nonzero((model.geom_contype == 0) & (model.geom_conaffinity == 0)))
    if drawn:
        notes.append(f"left out: {drawn} geoms that are drawn and touch nothing")
    moving = np.flatnonzero(getattr(model, "geom_surfacevel", np.zeros((model.ngeom, 6))).any(axis=1))
    if dropped := [geom for geom in moving if not surface_velocity(model, int(geom)).any()]:
        notes.append(f"left out: moving surfaces of {len(dropped)} geoms whose bodies can move")
    if model.npair or model.nexclude:
        notes.append(f"left out: {model.npair} pairs and {model.nexclude} exclusions of contact")
    unlimited = [
        int(joint) for joint in hinges if not model.jnt_limited[joint] and model.joint(joint).name in kept
    ]
    if unlimited:
        names = ", ".join(repr(model.joint(joint).name) for joint in unlimited[:5])
        more = f" and {len(unlimited) - 5} more" if len(unlimited) > 5 else ""
        notes.append(
            f"joints {names}{more}: without limits, or with equal ones; the scene has {UNLIMITED:g} rad"
        )
    return notes


def _count(values: np.ndarray) -> int:
    """Number of joints with a coefficient other than 0; polynomials have several."""
    return int(np.count_nonzero(values.reshape(len(values), -1 if len(values) else 1).any(axis=1)))
