"""Energy and momentum, and how contact changes them."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import MOMENT_WORK, Array
from touchstone.reports.metrics.context import Context, NotMeasured, Value, Values, measured
from touchstone.reports.metrics.motion.joints import driving, spring_energy
from touchstone.reports.metrics.posture import limit_excess
from touchstone.scenarios.scenario import UNMOVED

Mask = NDArray[np.bool_]

STORING = 1e-4
"""Overlap from which a soft contact may store elastic energy beyond rounding [m]."""
STORING_ANGLE = 1e-3
"""Excess over a joint's limit from which a soft limit may do so [rad]: 1e-4 m at the end of a hand."""


def energy_gain(context: Context) -> Values:
    """Largest E - E_0 over the largest kinetic energy of the truth, in scenes tagged `conservative` [1].

    In a scene without a closed form the divisor is the kinetic energy at the start. Frames in which a soft
    contact stores energy are excluded, as in `energy.injected`.
    """
    return {"": float(_change(context).max())}


def energy_loss(context: Context) -> Values:
    """Least E - E_0 over the largest kinetic energy of the truth, in scenes tagged `conservative` [1]."""
    return {"": float(_change(context).min())}


def _change(context: Context) -> Array:
    if "conservative" not in context.scenario.tags:
        raise NotMeasured("not tagged conservative: friction, impacts or a drive do work")
    energy = mechanical_energy(context, context.simulated)
    energy[_stores(context, context.simulated)] = np.nan
    kinetic = np.zeros(len(energy))
    r = context.recording
    for k in () if context.truths else context.simulated:
        start = (r.linear_velocity[:1, k], r.orientation[:1, k], r.angular_velocity[:1, k])
        kinetic += _kinetic(context, k, *start)
    for k, truth in context.truths.items():
        kinetic += _kinetic(context, k, truth.velocity, truth.orientation, truth.angular_velocity)
    free = energy[np.isfinite(energy)]
    if not len(free):
        raise NotMeasured(
            f"bodies overlap by more than {STORING:g} m in every frame: contacts may store energy"
        )
    return np.asarray((free - free[0]) / kinetic.max())


def energy_injected(context: Context) -> Values:
    """Largest rise over any window of S = K + U - W, with W the work done by the drive [J].

    Passive contact can only lower S, but a soft contact stores energy while it is compressed. A window
    therefore does not start in a frame in which a simulated body overlaps by more than STORING; for `all`,
    nor in one in which any body does or a hinge exceeds its limit by more than STORING_ANGLE.

    Subject `simulated`: only simulated bodies; W is the work of the impulses that driven bodies exert on
    them, J . (v- + v+) / 2 with the velocity of the simulated body at the contact. Subject `driven`, where
    driven bodies exert some: the same with the velocity of the driven body, as in `energy.drive`, so that a
    contact must not give more than its driver. Subject `all`, in scenes with driven bodies: every body; W is
    the work of the coupling springs and hinge servos; not measured where an engine poses its hinges itself.
    Prescribed bodies and those whose surface moves count as driven ones. U includes the springs of joints
    between bodies; not measured where such a joint drives its bodies: its work is not known.
    """
    if reason := driving(context.scenario):
        raise NotMeasured(reason)
    found: dict[str, float | Value] = {one: float(rise.max()) for one, rise in energy_rise(context).items()}
    if context.scenario.trackers and "all" not in found:
        found = {"all": Value(np.nan, "the drive is kinematic: its work is not known"), **found}
    return found


def energy_rise(context: Context, rigid: bool = False) -> dict[str, Array]:
    """Rise of S above its running minimum, per subject of `energy.injected` and per frame (f,) [J].

    Args:
        rigid: impacts are instants, and of those at one time the sum alone is passive: what drivers lose
            along the normals of their contacts with bodies that are not simulated counts as work, too.
    """
    found: dict[str, Array] = {}
    work = context.recording.driver_work
    if context.scenario.trackers and not np.isnan(work).any():
        moving = [k for k, kind in enumerate(context.kind) if kind not in UNMOVED]
        stores = _stores(context, moving) | (limit_excess(context).max(axis=1, initial=0.0) > STORING_ANGLE)
        found["all"] = _rise(mechanical_energy(context, moving) - work, stores)
    if context.simulated:
        energy, stores = mechanical_energy(context, context.simulated), _stores(context, context.simulated)
        found["simulated"] = _rise(energy - _work_of_driven_contacts(context), stores)
        given = _work_of_driven_contacts(context, "driven")
        if given.any():
            given += _normal_losses(context) if rigid else 0.0
            found["driven"] = _rise(energy - given, stores)
    return found


def energy_ledger(context: Context) -> Values:
    """Energy that simulated bodies gain over the run, per mechanism [J], where the engine reports it.

    friction, restitution: J . (v- + v+) / 2 along the contact plane and along its normal, v of B relative to
    A, without contacts of driven bodies; friction includes that of rolling and torsional friction. drive: the
    work of those. correction: the remaining change of K + U, due to pose correction and integration. Truth:
    only drive is above zero.
    """
    if context.recording.facts["engine"] != "reference":
        raise NotMeasured("only the reference tells impulses with the velocities before and after each")
    if context.scenario.body_joints:
        raise NotMeasured("the work of joints between bodies is not told")
    rows, drives = context.recording.contacts, context.drives
    free = ~drives[rows["body_a"]] & ~drives[rows["body_b"]]
    normal, tangential = context.impulses
    mean = rows["velocity_b_before"] - rows["velocity_a_before"]
    mean = (mean + rows["velocity_b_after"] - rows["velocity_a_after"]) / 2
    friction = np.einsum("ij,ij->i", tangential, mean)[free].sum()
    friction += context.recording.work[:, context.recording.work_names == MOMENT_WORK].sum()
    restitution = (normal * np.einsum("ij,ij->i", rows["normal"], mean))[free].sum()
    drive = _work_of_driven_contacts(context)[-1]
    energy = mechanical_energy(context, context.simulated)
    correction = energy[-1] - energy[0] - friction - restitution - drive
    parts = {"friction": friction, "restitution": restitution, "drive": drive, "correction": correction}
    return {name: float(value) for name, value in parts.items()}


def _stores(context: Context, bodies: list[int]) -> Array:
    """Mask of the frames in which a body overlaps by more than STORING: a soft contact stores energy."""
    stores, chosen = np.zeros(len(context.recording.time), dtype=bool), set(bodies)
    for pair, distance in context.distances.distance.items():
        if not chosen.isdisjoint(pair):
            stores |= distance < -STORING
    return stores


def _rise(s: Array, stores: Array) -> Array:
    lowest = np.minimum.accumulate(np.where(stores, np.inf, s))
    return np.asarray(np.where(stores, 0.0, s - lowest))


def mechanical_energy(context: Context, bodies: list[int]) -> Array:
    """Kinetic and potential energy per frame (f,) [J], springs of joints between bodies included; driven
    bodies feel no gravity."""
    r = context.recording
    energy = spring_energy(context)
    for k in bodies:
        energy += _kinetic(context, k, r.linear_velocity[:, k], r.orientation[:, k], r.angular_velocity[:, k])
        if context.kind[k] == "simulated":
            energy -= context.mass[k] * context.mass_centers[:, k] @ context.gravity
    return energy


def _kinetic(context: Context, body: int, velocity: Array, orientation: Array, omega: Array) -> Array:
    """Kinetic energy of a body per frame (f,) [J]."""
    moving = context.mass[body] * np.einsum("fi,fi->f", velocity, velocity)
    return np.asarray((moving + np.einsum("fi,fi->f", omega, spin(context, body, orientation, omega))) / 2)


def spin(context: Context, body: int, orientation: Array, omega: Array) -> Array:
    """Angular momentum I w of a body per frame (f, 3), world axes [kg m^2/s]."""
    turned = Rotation.from_quat(orientation, scalar_first=True)
    inertia = np.array(context.scenario.bodies[body].inertia)
    return np.asarray(turned.apply(turned.inv().apply(omega) @ inertia))


def energy_drive(context: Context) -> Values:
    """Work of each driver, prescribed body and moving surface on what it touches, J . (v- + v+) / 2 [J].

    J is the impulse on the other body, v the velocity of the driven link's surface at the contact before and
    after it. Contacts between links of one body are excluded: they do no work on others.
    """
    found = {name: float(work[-1]) for name, work in drive_work(context).items()}
    return measured(found, "the engine reports no impulse of a driven or prescribed body, or moving surface")


def drive_work(context: Context) -> dict[str, Array]:
    """Work of each driver's or moving surface's contacts by the end of each frame (f,) [J], by the name of
    its root or body."""
    rows, scenario, groups = context.recording.contacts, context.scenario, np.array(context.scenario.groups())
    # a body that only its surface drives is its own group
    alone = context.drives & (groups < 0)
    groups[alone] = len(scenario.trackers) + np.flatnonzero(alone)
    outside = groups[rows["body_a"]] != groups[rows["body_b"]]
    names = {k: tracker.root for k, tracker in enumerate(scenario.trackers)}
    names |= {int(groups[k]): scenario.bodies[k].name for k in np.flatnonzero(alone)}
    found = {}
    for k, name in names.items():
        of_a, of_b = (outside & (groups[rows[f"body_{side}"]] == k) for side in "ab")
        if (of_a | of_b).any():
            found[name] = _contact_work(context, "a", of_a) + _contact_work(context, "b", of_b)
    return found


def _work_of_driven_contacts(context: Context, at: Literal["simulated", "driven"] = "simulated") -> Array:
    """Work of driven bodies on simulated ones by the end of each frame (f,) [J], at the surface of one."""
    rows, kind = context.recording.contacts, np.array(context.kind)
    work = np.zeros(len(context.recording.time))
    for free, driven in ("ab", "ba"):
        chosen = (kind[rows[f"body_{free}"]] == "simulated") & context.drives[rows[f"body_{driven}"]]
        side, sign = (driven, 1.0) if at == "driven" else (free, -1.0)
        work += sign * _contact_work(context, side, chosen)
    return work


def _normal_losses(context: Context) -> Array:
    """Work of driven bodies along the normals of their contacts with bodies that are not simulated, by the
    end of each frame (f,) [J]."""
    rows, simulated = context.recording.contacts, np.array(context.kind) == "simulated"
    along = context.impulses[0][:, None] * rows["normal"]
    work = np.zeros(len(context.recording.time))
    for other, driven in ("ab", "ba"):
        chosen = context.drives[rows[f"body_{driven}"]] & ~simulated[rows[f"body_{other}"]]
        work += _contact_work(context, driven, chosen, along)
    return work


def _contact_work(context: Context, side: str, chosen: Mask, impulses: Array | None = None) -> Array:
    """Work (f,) [J] that the surfaces of A or B do on the other body in the chosen contact rows, by these
    impulses (n, 3) on B; None: all."""
    rows = context.recording.contacts
    mean = (rows[f"velocity_{side}_before"] + rows[f"velocity_{side}_after"]) / 2
    done = np.einsum("ij,ij->i", rows["impulse"] if impulses is None else impulses, mean)
    done *= np.where(chosen, 1.0 if side == "a" else -1.0, 0.0)
    by_frame = np.bincount(context.contact_frame + 1, weights=done, minlength=len(context.recording.time))
    return np.cumsum(by_frame)


MOMENTUM_ROUNDING = 1e-12
"""Angular momentum over (sum m |v|) times the distance of the centres below which it is rounding [1]."""


def momentum_linear(context: Context) -> Values:
    """Largest change of the sum of m v over the sum of m |v| at the start [1]; truth 0."""
    momenta = _momenta(context)
    change = np.linalg.norm(momenta.sum(axis=1) - momenta[0].sum(axis=0), axis=1)
    return {"": float(change.max() / _pace(momenta))}


def momentum_angular(context: Context) -> Values:
    """Largest change of the sum of L about the common centre over the largest sum of |L| [1]; truth 0."""
    momenta = _momenta(context)
    mass = context.mass[context.simulated]
    places = context.mass_centers[:, context.simulated]
    arms = places - np.average(places, axis=1, weights=mass)[:, None]
    drift = momenta.sum(axis=1) / mass.sum()
    turning = np.cross(arms, momenta - mass[:, None] * drift[:, None])
    for k, body in enumerate(context.simulated):
        r = context.recording
        turning[:, k] += spin(context, body, r.orientation[:, body], r.angular_velocity[:, body])
    scale = np.linalg.norm(turning, axis=2).sum(axis=1).max()
    if scale <= MOMENTUM_ROUNDING * _pace(momenta) * np.linalg.norm(arms, axis=2).max():
        raise NotMeasured("nothing turns")
    change = np.linalg.norm(turning.sum(axis=1) - turning[0].sum(axis=0), axis=1)
    return {"": float(change.max() / scale)}


def momentum_withheld(context: Context) -> Values:
    """Share of the momentum missing at the end from the body that should carry all of it [1]; truth 0."""
    momenta = _momenta(context)
    speeds = {k: np.linalg.norm(truth.velocity[[0, -1]], axis=1) for k, truth in context.truths.items()}
    giver, taker = ([k for k, speed in speeds.items() if speed[end] > 0] for end in (0, 1))
    if not len(giver) == len(taker) == 1 or giver == taker:
        raise NotMeasured("by the scene's truth no body hands all its momentum to another")
    before = momenta[0].sum(axis=0)
    after = momenta[-1, context.simulated.index(taker[0])]
    return {context.scenario.bodies[taker[0]].name: float(1 - after @ before / (before @ before))}


def _momenta(context: Context) -> Array:
    """m v of the simulated bodies (f, n, 3) [kg m/s]."""
    if "isolated" not in context.scenario.tags:
        raise NotMeasured("not tagged isolated: something outside pushes")
    bodies = context.simulated
    return np.asarray(context.recording.linear_velocity[:, bodies] * context.mass[bodies, None])


def _pace(momenta: Array) -> float:
    return float(np.linalg.norm(momenta[0], axis=1).sum())
