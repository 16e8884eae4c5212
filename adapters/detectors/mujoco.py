"""MuJoCo's signed distance of two geoms, with default settings or to rounding.

Conventions: `fromto` leads from a point on geom 1 to one on geom 2, against the normal in overlap; distance
is negative in overlap. Hulls are stored in single precision.
"""

from collections.abc import Mapping

import mujoco
import numpy as np

from touchstone.adapters.contract import Array, Scalar
from touchstone.adapters.detectors import Pair, PythonDetector, Query, unit
from touchstone.adapters.engines.mujoco.model import add_piece, hear_warnings

FAR = 100.0
"""Maximum distance of a query [m]: larger than that of any pair in the study."""
TIGHT_TOLERANCE = 1e-12
TIGHT_ITERATIONS = 200
"""`ccd_tolerance` [m] and `ccd_iterations` of the tight profile: queries end by tolerance only."""


class MujocoDetector(PythonDetector):
    """`mj_geomDistance`; `tight` lowers `ccd_tolerance`."""

    def __init__(self, tight: bool = False) -> None:
        self._tight = tight
        hear_warnings()

    def describe(self) -> Mapping[str, Scalar]:
        spec = mujoco.MjSpec()
        self._set_options(spec)
        option = spec.compile().opt
        return {
            "version": mujoco.mj_versionString(),
            "call": "mj_geomDistance",
            "ccd_tolerance": float(option.ccd_tolerance),
            "ccd_iterations": int(option.ccd_iterations),
        }

    def _set_options(self, spec: mujoco.MjSpec) -> None:
        if self._tight:
            spec.option.ccd_tolerance, spec.option.ccd_iterations = TIGHT_TOLERANCE, TIGHT_ITERATIONS

    def _query(self, pair: Pair) -> Query:
        spec = mujoco.MjSpec()
        self._set_options(spec)
        for name, piece in zip("ab", pair):
            add_piece(spec, spec.worldbody, piece, name)
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        a, b = model.geom("a").id, model.geom("b").id
        segment = np.zeros(6)

        def ask() -> float:
            return mujoco.mj_geomDistance(model, data, a, b, FAR, segment)

        def read(distance: float) -> tuple[float, Array]:
            return distance, unit((segment[3:] - segment[:3]) * np.sign(distance))

        return Query(ask, read)
