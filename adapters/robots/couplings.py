"""Couplings of joints in a robot's file, `mimic` of URDF and `joint` below `equality` of MJCF, both as MuJoCo
reads them: joints of a simulated robot that follow others linearly, and a start that obeys them."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from touchstone.adapters.robots.driven import Parts
from touchstone.adapters.robots.links import COUPLING, HINGE, SLIDE, joint_name, position_limits
from touchstone.scenarios.scenario import UNBOUNDED


class Coupling(NamedTuple):
    """The position of a joint is `offset` + `ratio` times that of the joint `other` of the model; both count
    from the model's reference."""

    other: int
    ratio: float
    offset: float


def couplings_of(model: Any, notes: list[str]) -> dict[int, Coupling]:
    """Couplings by the joint that follows, each with a joint that follows none; `notes` names the others."""
    found: dict[int, Coupling] = {}
    for k in np.flatnonzero(model.eq_type == COUPLING).tolist():
        joint, other = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        if reason := _reason(model, k, found):
            notes.append(f"left out: the coupling of joint {joint_name(model, joint)!r}: {reason}")
        else:
            offset, ratio = model.eq_data[k, :2].tolist()
            found[joint] = Coupling(other, ratio, offset)
    for joint in [*found]:
        passed = {joint}
        while (one := found[joint]).other in found and one.other not in passed:
            passed.add(one.other)
            inner = found[one.other]
            found[joint] = Coupling(
                inner.other, one.ratio * inner.ratio, one.offset + one.ratio * inner.offset
            )
        if one.other in passed:
            notes.append(f"left out: the coupling of joint {joint_name(model, joint)!r}: it follows itself")
            del found[joint]
    return found


def _reason(model: Any, k: int, found: Mapping[int, Coupling]) -> str:
    """Why an equality of joints cannot be kept; empty where it can."""
    joint, other, data = int(model.eq_obj1id[k]), int(model.eq_obj2id[k]), model.eq_data[k]
    if not model.eq_active0[k]:
        return "it is not active"
    if other < 0 or data[1] == 0:
        return "it holds the joint where it is"
    if data[2:5].any():
        return "it is not linear"
    if any(int(model.jnt_type[one]) not in (HINGE, SLIDE) for one in (joint, other)):
        return "it is one of a joint with several degrees of freedom"
    return "it has another" if joint in found else ""


def starts_of(model: Any, found: dict[int, Coupling], notes: list[str]) -> dict[int, float]:
    """Positions at the start of coupled joints [rad, m]: those that others follow are as near to 0 as the
    limits of all allow. A coupling that they do not allow is taken from `found`, with a note."""
    ranges = {one.other: position_limits(model, one.other, UNBOUNDED) for one in found.values()}
    for joint, one in [*found.items()]:
        ends = sorted((limit - one.offset) / one.ratio for limit in position_limits(model, joint, UNBOUNDED))
        low, high = (pick(both) for pick, both in zip((max, min), zip(ranges[one.other], ends)))
        if low <= high:
            ranges[one.other] = low, high
        else:
            name = joint_name(model, joint)
            notes.append(f"left out: the coupling of joint {name!r}: its limits do not allow it")
            del found[joint]
    starts = {other: float(np.clip(0.0, *limits)) for other, limits in ranges.items()}
    for joint, one in found.items():
        own = one.offset + one.ratio * starts[one.other]
        # rounding must not leave it beyond its limits
        starts[joint] = float(np.clip(own, *position_limits(model, joint, UNBOUNDED)))
    return starts


def couple_joints(parts: Parts, found: Mapping[int, Coupling]) -> None:
    """Couple the joints of a scene under construction."""
    names = {source: joint.name for source, joint in zip(parts.start, parts.body_joints)}
    place = {source: k for k, source in enumerate(parts.start)}
    for joint, one in found.items():
        own = parts.body_joints[place[joint]]
        parts.body_joints[place[joint]] = replace(own, mimics=names[one.other], ratio=one.ratio)
