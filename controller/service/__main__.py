"""``python -m controller.service plan PARENT JOB``: what the engine starts; nothing for an operator."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from controller.runtime import children


def main(arguments: Sequence[str]) -> int:
    role, parent, job = arguments
    children.end_with(int(parent))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends us, in order
    children.name_process(f"directrix-{role}")
    from controller.runtime import plan_end
    from controller.service import planning

    return children.run(role, planning.main, Path(job), plan_end.EXPECTED)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
