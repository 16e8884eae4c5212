"""Restitution and friction in MuJoCo: masks and priorities of geoms (`masks.py`), otherwise explicit pairs.

MuJoCo has springs instead of e. A pair with e = 0 gets MuJoCo's own form, solref = (time constant, 1): 20 ms
in `default` and `equal-step`, else REST_STEPS (MuJoCo's documentation, "Modeling: Solver parameters").

A pair that bounces takes its stiffness and damping per unit mass in the direct form solref = (-stiffness,
-damping). Its contact releases while still compressed, when its force would become negative (Schwager &
Poeschel 2007): with zeta = cos t, or cosh t beyond critical damping, the restitution is
e = exp(-2 t cot t), or exp(-2 t coth t). Because MuJoCo integrates stiffness and damping explicitly, they are
chosen so that the *discrete steps* have the spring's decay and frequency. The stiffer the spring, the fewer
steps a bounce takes and the more e depends on where within a step it starts: `bounce` bounds its frequency
times the step. Friction is set per pair; mu = 0 is a frictionless contact (condim 1).

Torsional friction takes condim 4, rolling friction 6; their coefficients are lengths. In the elliptic cone
friction, spin and rolling share one bound, sum (f_i / mu_i)^2 <= f_n^2: a contact that needs friction to roll
has a little less of a moment.

In `accurate` the impedance does not depend on depth, so the spring is linear. Friction has its own damping
(solreffriction, for the elliptic cone only), no higher than by default: at the normal force's stiffness it
would throw a sliding body off the ground.
"""

from collections.abc import Iterable, Mapping
from itertools import combinations
from math import acos, acosh, cos, cosh, exp, hypot, log, pi, sqrt, tan, tanh
from typing import Any

from scipy.optimize import brentq

from touchstone.adapters.contract import Array, Settings, Unsupported
from touchstone.adapters.engines.mujoco.masks import GeomFilter, contact_filter
from touchstone.adapters.engines.mujoco.settings import SETTINGS
from touchstone.adapters.material_combine import check_range, friction_lengths, frictions, restitutions
from touchstone.adapters.registry import ACCURATE, DEFAULT
from touchstone.scenarios.scenario import Scenario

REST_STEPS = 2.6
"""Time constant of a contact that does not bounce, where none is set [steps]. MuJoCo's limit is two (its flag
refsafe); there friction lifts what slides or rolls, and `slip` rolls 11 % late."""
PULLING = (DEFAULT, "equal-step")
"""Profiles with MuJoCo's 20 ms and the restitution of a spring that may also pull, which is too large."""
FLOOR_STEPS = 2.0
"""MuJoCo's lower limit of a contact's time constant [steps]."""
FRICTION_MIN = 1e-5
"""Minimum friction of a contact with condim > 1 (mjMINMU) [1]; MuJoCo raises smaller values to it."""
RESTITUTION_MIN = 0.02
"""Minimum restitution of a pair that bounces [1]: 0 would need infinite damping. In
`accurate` also that of 0."""
STIFFNESS_UNUSED = -1.0
"""-stiffness of friction's own solref [1/s^2]: friction has damping alone, but both numbers need one sign."""
ROUNDING = 1e-9
"""Relative error of a restitution converted to a solref and back."""


def solref_of(restitution: float, settings: Settings) -> tuple[float, float]:
    """(-stiffness, -damping) per unit mass, or (time constant, damping ratio), of a contact with e."""
    values = SETTINGS.in_force(settings.profile, settings.changes)
    constant = values.get("solref", 0.0)
    if settings.profile in PULLING:
        zeta = 1.0 if restitution == 0 else -log(restitution) / hypot(pi, log(restitution))
        w = 1 / max(constant * zeta, FLOOR_STEPS * settings.dt)
        return -w * w, -2 * zeta * w
    if restitution == 0 and settings.profile != ACCURATE:
        return max(constant or REST_STEPS * settings.dt, FLOOR_STEPS * settings.dt), 1.0
    zeta, stiffest = releasing_ratio(max(restitution, RESTITUTION_MIN)), values["bounce"] / settings.dt
    w = min(1 / (zeta * constant), stiffest) if zeta * constant else stiffest
    return _sampled(zeta, w, settings.dt)


def restitution_of(solref: Array, settings: Settings) -> float:
    """Restitution e of a contact with a solref, the inverse of `solref_of`."""
    if solref[0] > 0:
        return 0.0
    if settings.profile in PULLING:
        zeta = -solref[1] / (2 * sqrt(-solref[0]))
        return exp(-pi * zeta / sqrt(1 - zeta * zeta)) if zeta < 1 else 0.0
    e = releasing_restitution(_damping_ratio(solref, settings.dt))
    return e if settings.profile != ACCURATE or e > RESTITUTION_MIN * (1 + ROUNDING) else 0.0


def releasing_restitution(zeta: float) -> float:
    """Restitution of a damped spring that cannot pull, as a function of the damping ratio."""
    if zeta == 1:
        return exp(-2)
    angle = acos(zeta) if zeta < 1 else acosh(zeta)
    return exp(-2 * angle / (tan(angle) if zeta < 1 else tanh(angle)))


def releasing_ratio(restitution: float) -> float:
    """Damping ratio of a damped spring that cannot pull, for a restitution in (0, 1]."""
    lost = -log(restitution) / 2
    if lost == 0:
        return 0.0
    if lost == 1:
        return 1.0
    if lost < 1:
        return cos(brentq(lambda t: t / tan(t) - lost, 1e-12, pi / 2))
    return cosh(brentq(lambda t: t / tanh(t) - lost, 1e-12, lost))


def _sampled(zeta: float, w: float, dt: float) -> tuple[float, float]:
    """(-stiffness, -damping) whose semi-implicit steps have the damped spring's decay and frequency."""
    decay, root = exp(-zeta * w * dt), w * dt * sqrt(abs(1 - zeta * zeta))
    turn = cos(root) if zeta < 1 else cosh(root)
    return -(1 + decay * decay - 2 * decay * turn) / dt**2, -(1 - decay * decay) / dt


def _damping_ratio(solref: Array, dt: float) -> float:
    """Damping ratio from a solref of `_sampled`."""
    decay = sqrt(1 + solref[1] * dt)
    turn = (1 + decay * decay + solref[0] * dt**2) / (2 * decay)
    root = acos(turn) if turn < 1 else acosh(turn)
    square = root * root if turn < 1 else -root * root
    return -log(decay) / sqrt(log(decay) ** 2 + square)


def add_contacts(
    spec: Any, bodies: Mapping[int, Any], scenario: Scenario, settings: Settings, masks: bool
) -> None:
    """Add the contacts of all touching pairs with their coefficients.

    Args:
        bodies: the spec's body per index in the scenario; their geoms have masks of zero.
        masks: whether masks and priorities of geoms may choose what meets, and how.
    """
    check_range("mujoco", "friction", scenario, frictions(scenario), least=FRICTION_MIN)
    if settings.profile not in PULLING:
        check_range("mujoco", "restitution", scenario, restitutions(scenario), least=RESTITUTION_MIN)
    moments = friction_lengths(scenario, "rolling"), friction_lengths(scenario, "torsional")
    slippery = [
        pair for pair, mu in frictions(scenario).items() if mu == 0 < moments[0][pair] + moments[1][pair]
    ]
    if slippery:
        one, two = (scenario.bodies[k].name for k in slippery[0])
        raise Unsupported(f"mujoco: rolling or torsional friction needs mu > 0, found 0 for {one} and {two}")
    has_moments = any(any(lengths.values()) for lengths in moments)
    if not masks or has_moments or "solreffriction" in SETTINGS.in_force(settings.profile, settings.changes):
        # Geoms have no solreffriction, and masks choose by restitution and friction.
        add_pairs(spec, scenario, settings, scenario.touching_pairs())
        return
    found = contact_filter(scenario)
    for k, chosen in found.geoms.items():
        for geom in bodies[k].geoms:
            _set_geom(geom, chosen, settings)
    for a, b in found.excluded:
        spec.add_exclude(bodyname1=bodies[a].name, bodyname2=bodies[b].name)
    add_pairs(spec, scenario, settings, found.explicit)


def _set_geom(geom: Any, chosen: GeomFilter, settings: Settings) -> None:
    e, mu = chosen.coefficients
    geom.contype, geom.conaffinity, geom.priority = chosen.contype, chosen.conaffinity, chosen.priority
    geom.condim, geom.friction, geom.solref = 3 if mu > 0 else 1, (mu, 0.0, 0.0), solref_of(e, settings)
    geom.solimp = SETTINGS.in_force(settings.profile, settings.changes)["solimp"]


def add_pairs(spec: Any, scenario: Scenario, settings: Settings, pairs: Iterable[tuple[int, int]]) -> None:
    """Add an explicit pair for every two geoms of pairs of bodies; MuJoCo uses it instead of masks."""
    values = SETTINGS.in_force(settings.profile, settings.changes)
    options: dict[str, Any] = {"solimp": values["solimp"]}
    if "solreffriction" in values:
        options["solreffriction"] = (STIFFNESS_UNUSED, -2 / values["solreffriction"])
    for a, b in pairs:
        e, mu = scenario.pair_coefficients(a, b)
        law = scenario.friction_law(a, b)
        dimensions = 6 if law.rolling > 0 else 4 if law.torsional > 0 else 3
        for first in range(len(scenario.bodies[a].pieces)):
            for second in range(len(scenario.bodies[b].pieces)):
                spec.add_pair(
                    geomname1=f"{a}.{first}",
                    geomname2=f"{b}.{second}",
                    condim=dimensions if mu > 0 else 1,
                    friction=(mu, mu, law.torsional, law.rolling, law.rolling),
                    solref=solref_of(e, settings),
                    **options,
                )


def contact_parameters(model: Any) -> dict[tuple[int, int], tuple[int, Array, float]]:
    """Condim, solref and sliding friction for all pairs of a compiled model's bodies (a < b) that may meet:
    those of explicit pairs, otherwise those of the geom that masks and priorities choose."""
    found = {}
    geoms = [k for k in range(model.ngeom) if model.geom_contype[k] or model.geom_conaffinity[k]]
    first = {int(model.geom_bodyid[k]): k for k in reversed(geoms)}
    for (a, one), (b, two) in combinations(sorted(first.items()), 2):
        masks = model.geom_contype[[one, two]] & model.geom_conaffinity[[two, one]]
        if masks.any():
            # At equal priority both geoms have the same parameters.
            k = one if model.geom_priority[one] >= model.geom_priority[two] else two
            found[a, b] = int(model.geom_condim[k]), model.geom_solref[k], float(model.geom_friction[k, 0])
    for k, geoms_of in enumerate(zip(model.pair_geom1, model.pair_geom2)):
        a, b = sorted(int(model.geom_bodyid[geom]) for geom in geoms_of)
        found[a, b] = int(model.pair_dim[k]), model.pair_solref[k], float(model.pair_friction[k, 0])
    return found
