"""``python -m controller.runtime ROLE PARENT ...``: what the engine starts; nothing for an operator.

tick JOB                the real-time process of a machine (tick_process.py)
plan JOB                its plan (planning.py)
bus JOB                 a virtual bus with the machine's simulated devices (bench/bus.py)
inverter JOB            what talks to a spindle's inverter on a serial line (inverter_process.py)
hub JOB                 a virtual bus that shares an adapter (drives.bench)
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from controller.runtime import children
from drives import real_time


def main(arguments: Sequence[str]) -> int:
    role, parent, *rest = arguments
    children.end_with(int(parent))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends us, in order
    if role == "hub":
        from controller.runtime import simulation
        from drives.bus import BusError

        real_time.name_process("virtual-bus")
        return children.run(role, simulation.share_adapter, Path(rest[0]), (OSError, BusError))
    if role == "bus":
        from controller.machine.toml_table import ConfigError
        from controller.runtime import simulation

        real_time.name_process("virtual-bus")
        return children.run(role, simulation.serve_bus, Path(rest[0]), (OSError, ConfigError))
    real_time.name_process(f"directrix-{role}")
    if role == "plan":
        from controller.runtime import plan_end, planning

        return children.run(role, planning.main, Path(rest[0]), plan_end.EXPECTED)
    if role == "inverter":
        from controller.machine.toml_table import ConfigError
        from controller.runtime import inverter_process

        return children.run(role, inverter_process.main, Path(rest[0]), (ConfigError,))
    from controller.runtime import tick_process
    from drives.bus import BusError

    return children.run(role, tick_process.main, Path(rest[0]), (BusError,))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
