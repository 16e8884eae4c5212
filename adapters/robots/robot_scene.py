"""Scene of a robot: driven bodies that trackers hold in their start posture, or simulated bodies that joints
connect; and the model's surroundings.

A tree of bodies becomes a driven body; one without hinges that can move, a simulated body; what stands
still, a fixed one. Joints of a driven root are replaced by the tracker's pose. A model without a floor gets
one.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import AdapterError
from touchstone.adapters.motion_bounds import planned
from touchstone.adapters.robots.couplings import couple_joints, couplings_of, starts_of
from touchstone.adapters.robots.driven import (
    DURATION,
    MOST_CHAINS,
    Parts,
    add_hinges,
    free_name,
    named_once,
    place_floor,
)
from touchstone.adapters.robots.left_out import friction_of, left_out, listed
from touchstone.adapters.robots.link_body import body_of
from touchstone.adapters.robots.links import HINGE, TreeBuilder, joints_of, world_pose
from touchstone.adapters.robots.mechanism import Simulated, add_exclusions, add_mechanism
from touchstone.adapters.robots.motors import drives_of
from touchstone.adapters.robots.pieces import PieceMaker, geoms_of, quaternion
from touchstone.adapters.robots.robot_error import RobotError
from touchstone.adapters.robots.source import Source, compiled
from touchstone.scenarios.avatar.surface_motion import piece_moves
from touchstone.scenarios.scenario import Body, PairCoefficients, Scenario, ScenarioError, vector

BASE_END = "_base"
"""Ending of the name of a base on which a root turns."""
SIMULATED_DURATION = 10.0
"""Duration of the scene of a simulated robot [s]: time to stand or to fall and come to rest."""
LEFT_OUT = "left out: body"
NOTHING_MOVES = "nothing in it can move"
"""Why a file of materials, a floor or a mount is no scene."""


@dataclass(frozen=True, slots=True)
class Imported:
    """A robot's scene, a line for each thing that could not be kept as it was, and of a simulated robot the
    positions of the joints at the start, as the file counts them [rad, m]."""

    scenario: Scenario
    notes: tuple[str, ...]
    start: Mapping[str, float] = field(default_factory=dict)


def imported(
    path: Path, name: str, allow_paths: bool = False, simulated: Simulated | None = None
) -> Imported:
    """Scene called `name` of a URDF or MJCF file.

    Args:
        allow_paths: whether files outside the robot's folder may be read.
        simulated: how links become simulated bodies; None for driven ones.
    Raises:
        RobotError: the file is not valid, or holds what no scene can represent; a line per fault.
    """
    source = compiled(path, allow_paths)
    notes, parts = [f"MuJoCo: {text}" for text in source.warned], Parts()
    if source.turned:
        notes.append(f"quarter turns: exact for shapes of {listed('link', source.turned)}")
    try:
        scenario = _scene(source, (name, path.name), parts, notes, simulated)
    except ScenarioError as error:
        lines = "\n".join(f"{path}: {where}: {text}" for where, text in error.faults)
        raise RobotError(lines) from error
    except RobotError as error:
        raise RobotError(f"{path}: {error}") from error
    if simulated is not None:
        start = {joint.name: q for joint, q in zip(scenario.body_joints, parts.start.values())}
        return Imported(scenario, (*notes, *left_out(source, None)), start)
    try:
        planned(scenario, None)
    except AdapterError as error:
        # Links that may overlap can only be played if they may touch.
        scenario = replace(scenario, effects=(*scenario.effects, "self_collision"))
        notes.append(f"self-collision: on, since {str(error).removeprefix('effects: ').partition(';')[0]}")
    chained = sum(len(chain.joints) for chain in scenario.chains)
    if chained < len(scenario.joints):
        notes.append(
            f"chains: the reference turns {chained} of {len(scenario.joints)} hinges where the robot is held "
            f"back, those of the {MOST_CHAINS} longest runs; the others follow the tracker"
        )
    kept = {joint.name for joint in scenario.joints}
    return Imported(scenario, (*notes, *left_out(source, kept)))


def _scene(
    source: Source, names: tuple[str, str], parts: Parts, notes: list[str], simulated: Simulated | None
) -> Scenario:
    """The scene, by its name and that of its file, whose `parts` are empty before."""
    model, (name, file) = source.model, names
    maker = PieceMaker(model, notes)
    drives = {} if simulated is None else drives_of(model, notes)
    coupled = {} if simulated is None else couplings_of(model, notes)
    parts.coupled |= starts_of(model, coupled, notes)
    _add_fixed(model, 0, "world", maker, parts)
    for body in range(1, model.nbody):
        if model.body_parentid[body] != 0:
            continue
        tree = [other for other in range(model.nbody) if model.body_rootid[other] == body]
        if source.form == "mjcf" and not any(len(joints_of(model, other)) for other in tree):
            for other in tree:
                _add_fixed(model, other, model.body(other).name or f"body_{other}", maker, parts)
        elif simulated is None:
            _add_tree(source, body, maker, parts, notes)
        else:
            add_mechanism(source, body, maker, drives, simulated, parts, notes)
    if simulated is not None:
        couple_joints(parts, coupled)
        add_exclusions(maker, parts, notes)
    if not parts.trackers and not any(body.kind == "simulated" for body in parts.bodies):
        raise RobotError(NOTHING_MOVES)
    friction = friction_of(source, notes)
    pairs = (("robot", "robot"), ("robot", "floor"))
    place_floor(parts, notes)
    return Scenario(
        name=name,
        summary=f"{file}, imported",
        tags=(),
        bodies=tuple(parts.bodies),
        duration=DURATION if simulated is None else SIMULATED_DURATION,
        coefficients=tuple(PairCoefficients(a, b, 0.0, friction) for a, b in pairs),
        joints=tuple(parts.joints),
        trackers=tuple(parts.trackers),
        chains=tuple(parts.chains),
        gravity=vector(model.opt.gravity),
        body_joints=tuple(parts.body_joints),
        contact_exclusions=tuple(parts.contact_exclusions),
    )


def _add_fixed(model: Any, body: int, name: str, maker: PieceMaker, parts: Parts) -> None:
    """Fixed bodies of a body that cannot move, in the world's frame: one, and one per moving surface, since
    not every engine has several in one body."""
    place, turn = world_pose(model, body)
    pieces = {geom: maker.standing(geom, place, turn) for geom in geoms_of(model, body)}
    moving = [geom for geom, own in pieces.items() if piece_moves(own[0])]
    still = [geom for geom in pieces if geom not in moving]
    for kept, label in ((still, name), *(([geom], pieces[geom][0].name) for geom in moving)):
        if kept:
            label = free_name(label, [other.name for other in parts.bodies])
            own = [piece for geom in kept for piece in pieces[geom]]
            parts.bodies.append(Body(label, "fixed", "floor", named_once(own)))
            parts.geoms[label] = (0, kept)


def _add_tree(source: Source, body: int, maker: PieceMaker, parts: Parts, notes: list[str]) -> None:
    """What hangs on the world by one body: a driven body or a simulated one."""
    model = source.model
    own = [int(model.jnt_type[joint]) for joint in joints_of(model, body)]
    # A root that only turns hangs on a base; any other joint of it gives way to the tracker's pose.
    base = f"{model.body(body).name or 'root'}{BASE_END}" if own and set(own) == {HINGE} else None
    builder = TreeBuilder(model, notes)
    builder.add_root(body, base)
    if own and not base and any(kind != 0 for kind in own):
        names = ", ".join(repr(model.joint(joint).name) for joint in joints_of(model, body))
        notes.append(f"joints {names} of the root give way to the pose of its tracker")
    links = builder.links
    bodies: list[Body] = []
    for k, link in enumerate(links):
        link.name = free_name(link.name, [one.name for one in (*parts.bodies, *bodies)])
        bodies.append(body_of(link, maker, notes, is_root=k == 0))
    if len(links) > 1:
        parts.bodies += bodies
        add_hinges(links, parts)
        return
    if not bodies[0].pieces:
        notes.append(f"{LEFT_OUT} {bodies[0].name!r}, which has neither hinges nor a shape that collides")
        return
    pose = {
        "position": vector(links[0].place),
        "orientation": quaternion(Rotation.from_matrix(links[0].turn)),
    }
    parts.bodies.append(replace(bodies[0], kind="simulated", **pose))  # type: ignore[arg-type]
