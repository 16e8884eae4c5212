"""The pipeline of Schmidl & Lin (2004) as printed, and nothing else: profile `paper`.

Read in this order: `frame` (figure 3), `virtual_coupling` (Eq. 6), `attraction`, `penetration_depth`
(algorithm 1, Eq. 1), `overlap_avoidance` (Eqs. 2 and 3), `ccd_ik` (Eqs. 4 and 5), `integration`, `impulses`
(Eqs. 7 to 9), `friction` (Eq. 10); `vectors` has the algebra of the equations, `kinematics/` the links and
the reach cones. A sentence that begins with "The paper leaves open" marks every decision of ours;
docs/method.md lists them.

Conventions: SI, radians, z up. A contact normal n points from A to B; the paper's points from B to A, so its
signs are turned here. Signed distance is negative in overlap, and depth = max(0, -distance).
"""
