"""A blade as one block of G6.2, run to its end on the stepped machine."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline
from support.machines.stepped_runs import T2, cut, largest, shipped
from support.parts.nurbs_text import blade, nurbs

from controller.motion.motions import SurfaceCut

RADIUS_MM = 1.5


def test_a_cubic_blade_of_twelve_points_keeps_contact_and_feed_within_all_limits() -> None:
    upper, lower = blade()
    done = cut(T2.format(side="G42", cuts=nurbs(upper, lower, " F1000.")), shipped())
    first, second, third = largest(done.joints, done.machine)
    assert first <= 1.0005 and second <= 1.002 and third <= 1.02
    top, bottom = (BSpline(np.array(c.knots) / c.knots[-1], np.array(c.points), 3) for c in (upper, lower))
    cuts = [i for i, segment in done.segments.items() if isinstance(segment.motion, SurfaceCut)]
    assert len(cuts) == 9
    ids, s = done.column("motion_id"), done.column("s")
    part = done.machine.offsets[0]
    seen = 0
    for i in range(0, len(ids), 7):
        if int(ids[i]) not in cuts:
            continue
        motion = done.segments[int(ids[i])].motion
        assert isinstance(motion, SurfaceCut)
        u = (cuts.index(int(ids[i])) + motion.arc.u_at(float(s[i]))) / 9.0
        a, b, c, d, e = map(float, done.joints[i])
        pose = done.kinematics.forward((a, b, c, d, e), motion.length_mm)
        out = np.cross(bottom(u, 1), top(u) - bottom(u))
        tip = np.array(part.from_parent(pose.tip))
        assert np.linalg.norm(tip - RADIUS_MM * out / np.linalg.norm(out) - bottom(u)) < 1e-6
        seen += 1
    assert seen > 200
