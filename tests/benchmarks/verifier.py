"""What verifying costs: 10^5 points of Example 2's first surface against 10^4 poses of its cut.

    python tests/benchmarks/verifier.py

Prints processor seconds and the largest resident memory.
"""

from __future__ import annotations

import resource
import sys
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from support.oracles.swept_cylinder import nominal, places, sweep  # noqa: E402
from support.parts.paper_surfaces import example_2  # noqa: E402

from controller.verify.bodies import cutter  # noqa: E402
from controller.verify.envelope import deviation  # noqa: E402
from controller.verify.passes import longest  # noqa: E402


def main() -> None:
    one = nominal(example_2()[0])
    poses, body = sweep(one, 0.0055), cutter(one.tool, longest([one]))
    _, _, points, normals = places(one, 1000, 100)
    began_s = time.process_time()
    t = deviation(points, normals, poses, body, one.tool.radius_mm).t
    took_s = time.process_time() - began_s
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(f"{len(points)} points, {len(poses)} poses: {took_s:.1f} s, {memory_mb:.0f} MB")
    print(f"largest overcut {-t.min():.5f} mm")


if __name__ == "__main__":
    main()
