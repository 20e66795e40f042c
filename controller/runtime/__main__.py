"""``python -m controller.runtime ROLE PARENT ...``: what the engine starts; nothing for an operator.

tick JOB                the real-time process of a machine (processes.py)
hub PATH OPTIONS        a virtual bus with simulated drives (drives.simulated)
bench JOB               the same of the axes, with a part that can be touched (simulated_bench.py)
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from controller.runtime import children


def main(arguments: Sequence[str]) -> int:
    role, parent, *rest = arguments
    children.end_with(int(parent))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends us, in order
    if role == "hub":
        from drives.simulated.__main__ import main as serve

        children.name_process("virtual-bus")
        serve(rest)
        return 0
    if role == "bench":
        from controller.runtime import processes, simulated_bench

        children.name_process("virtual-bus")
        return processes.run(role, simulated_bench.main, Path(rest[0]))
    children.name_process(f"directrix-{role}")
    from controller.runtime import processes

    return processes.run(role, processes.tick_main, Path(rest[0]))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
