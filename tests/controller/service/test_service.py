"""What the service concludes from what it sees, without any process."""

from __future__ import annotations

from pathlib import Path

import pytest
from cutting import shipped

from controller import handoff
from controller.door import DoorError
from controller.handoff import Snapshot
from controller.service.service import Service


class _KilledTick:
    """An engine whose tick has just been killed; the next one lives, and its bus cannot be heard."""

    def __init__(self) -> None:
        self.machine = shipped()
        self.tick_alive, self.plan_alive, self.recorder = False, True, None

    def snapshot(self) -> Snapshot:
        return handoff._snapshot(handoff._SNAPSHOT.unpack(bytes(handoff._SNAPSHOT.size)))

    def last_words(self) -> str:
        return "The tick process was killed by signal SIGKILL."

    def start(self) -> None:
        self.tick_alive = True


def test_a_reset_before_anybody_saw_the_tick_die_loses_no_alarm(tmp_path: Path) -> None:
    service = Service(shipped(), tmp_path)
    service.engine = _KilledTick()  # type: ignore[assignment]
    with pytest.raises(DoorError, match="can0"):  # no bus is there
        service.start_engine()
    service.look()
    (alarm,) = service.alarms.list()
    assert alarm["name"] == "CONTROLLER_GONE"
    assert "SIGKILL" in alarm["sentence"]
