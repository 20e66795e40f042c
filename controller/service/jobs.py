"""The program that is loaded, and what has become of it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from controller.door import DoorError
from controller.handoff import Snapshot
from controller.machine import Machine
from controller.plan.route.spot import Spot
from controller.service.orders import News, Program, Way

MDI = "MDI"
MOST_BYTES = 1 << 30  # of a program


@dataclass(slots=True)
class Job:
    """One program; ``state``: loading, loaded, starting, running, held, stopping, then how it ended."""

    program: Program
    sha256: str
    state: str = "loading"
    duration_s: float | None = None
    blocks: int | None = None
    notes: list[dict[str, Any]] = field(default_factory=list)
    restart: list[str] = field(default_factory=list)  # the state at the place where it begins
    origin_s: float = 0.0  # plan time at which its first piece begins
    ways: dict[int, Way] = field(default_factory=dict)
    news: News = field(default_factory=News)
    sentence: str = ""  # why it ended

    @property
    def is_mdi(self) -> bool:
        """A line typed by hand."""
        return self.program.name == MDI

    @property
    def active(self) -> bool:
        """Between the start and the end."""
        return self.state in ("starting", "running", "held", "stopping")

    def hear(self, news: News) -> None:
        """What the plan tells while it runs."""
        self.ways.update(news.ways)
        self.news = news

    def way(self, motion_id: int) -> Way | None:
        """Of the motion under way; those that lie behind it are forgotten."""
        for old in [name for name in list(self.ways) if 0 <= name < motion_id]:
            self.ways.pop(old, None)
        return self.ways.get(motion_id)

    def to_dict(self, now: Snapshot) -> dict[str, Any]:
        left_s = self._left_s(now)
        share = None if left_s is None or not self.duration_s else 1.0 - min(1.0, left_s / self.duration_s)
        return {
            "name": self.program.name,
            "sha256": self.sha256,
            "state": self.state,
            "line": now.line if self.active else self.program.spot.line if self.program.spot else None,
            "restart": self.restart,
            "dry_run_mm": self.program.dry_run_mm or None,
            "block": now.motion_id if self.active and now.motion_id >= 0 else None,
            "fraction": share,
            "blocks": self.blocks,
            "duration_s": self.duration_s,
            "elapsed_s": max(0.0, now.plan_time_s - self.origin_s) if self.active else None,
            "left_s": left_s,
            "checking": self.news.checking,
            "notes": self.notes,
            "sentence": self.sentence or None,
        }

    def _left_s(self, now: Snapshot) -> float | None:
        """Exact once all has been planned; before it by the check, which planned all of it at 100 %."""
        if not self.active:
            return self.duration_s if self.state == "loaded" else None
        if self.news.finished and self.state != "starting":
            return max(0.0, now.queue_end_s - now.plan_time_s)
        if self.duration_s is None:
            return None
        return max(0.0, self.duration_s - (now.plan_time_s - self.origin_s))


def read(args: dict[str, Any], machine: Machine) -> Job:
    """The job of a ``load``. Raises DoorError."""
    path = Path(str(args.get("path", "")))
    try:
        if path.stat().st_size > MOST_BYTES:
            raise DoorError("bad", f"{path}: is larger than {MOST_BYTES >> 20} MB; split the program.")
        text = path.read_bytes()
    except OSError as error:
        raise DoorError(
            "bad", f"{path}: cannot be read: {error.strerror}; upload the program again."
        ) from error
    found = hashlib.sha256(text).hexdigest()
    wanted = args.get("sha256")
    if wanted is not None and wanted != found:
        raise DoorError("bad", f"{path}: its sha256 is {found}, not {wanted}; upload the program again.")
    line, fraction = _whole(args, "line"), _number(args, "fraction", 0.0, 1.0) or 0.0
    if fraction and not line:
        raise DoorError("bad", f"fraction {fraction:g}: of which line? Give line, too.")
    spot = Spot(line, fraction) if line else None
    dry_run_mm = _number(args, "dry_run_mm", 0.0, 1000.0) or 0.0
    name = str(args.get("name") or path.name)
    return Job(Program(text, name, machine, spot, dry_run_mm=dry_run_mm), found)


def mdi(text: str, machine: Machine) -> Job:
    """A line of program typed by hand."""
    data = text.encode()
    return Job(Program(data, MDI, machine), hashlib.sha256(data).hexdigest())


def _whole(args: dict[str, Any], key: str) -> int:
    value = args.get(key)
    if value is None:
        return 0
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise DoorError("bad", f"{key} {value!r}: must be a whole number from 0; correct it.")
    return value


def _number(args: dict[str, Any], key: str, lowest: float, highest: float) -> float | None:
    value = args.get(key)
    if value is None:
        return None
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not lowest <= value <= highest:
        raise DoorError(
            "bad", f"{key} {value!r}: must be a number from {lowest:g} to {highest:g}; correct it."
        )
    return float(value)
