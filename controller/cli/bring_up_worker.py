"""The process that conducts one step of a bring-up for the panel: lines of JSON, the first of them a job.

    -> {"state": folder, "protocol": folder, "step": "scale.X", "part": [path, name] or null, "url": of the
        panel, "headers": of who asks, "language": "en", "parent": process id}
    <- {"number": 1, "question": "value", "confirm", "hand" or "watch", "text": {"key": ..., "values": ...}}
       the question null: what was watched for has come
    -> {"number": 1, "answer": a number, true or false; null: he leaves the step}
    <- {"ended": null, or why the step was not ended}

It moves the machine as any script does: over REST, with the rights and the control of whoever has asked for
the step. "watch" asks for something that the control sees by itself; it needs no answer.
"""

from __future__ import annotations

import contextlib
import json
import select
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from controller import own_files
from controller.bringup import protocol as protocols
from controller.bringup import report
from controller.bringup import steps as declared
from controller.bringup.conduct import carry_out
from controller.bringup.site import Site
from controller.bringup.ticks import NotDone
from controller.cli import remote
from controller.cli.live_bench import LiveBench
from controller.messages import Message, message, of_error
from controller.runtime import children
from controller.store import set_up_store
from controller.verify.console import Refused, spoken


def main() -> None:
    job = json.loads(sys.stdin.readline())
    children.end_with(int(job["parent"]))
    spoken.set(job["language"])
    try:
        why = conducted(job)
    except Refused as refused:
        why = message("text", text=str(refused))
    except (OSError, ValueError) as error:
        why = of_error(error)
    print(json.dumps({"ended": why}), flush=True)


def conducted(job: dict[str, Any]) -> Message | None:
    """Why the step was not ended, where it was not. Raises Refused, OSError, ValueError."""
    machine = set_up_store.machine(Path(job["state"]))
    steps = declared.steps(machine)
    (step,) = [one for one in steps if one.name == job["step"]]
    kept = Path(job["protocol"])
    own_files.make_folder(kept)
    protocol = protocols.opened(kept, machine, simulated=False)
    with tempfile.TemporaryDirectory() as folder, remote.client(job["url"], job["headers"], own=True) as http:
        part = _named(job["part"], Path(folder))
        bench = LiveBench(remote.Machine(http), machine)
        why = carry_out(step, Site(bench, AtPage(), protocol, part))
    report.write(protocol, steps)
    return why


def _named(part: tuple[str, str] | None, folder: Path) -> Path | None:
    """A program of the store under its own name. Raises OSError."""
    if part is None:
        return None
    return Path(shutil.copyfile(part[0], folder / Path(part[1]).name))


class AtPage:
    """The operator before the page."""

    def __init__(self) -> None:
        self._number = 0

    def value(self, question: Message) -> float:
        return float(self._answer_to("value", question))

    def confirms(self, question: Message) -> bool:
        return bool(self._answer_to("confirm", question))

    def does(self, request: Message) -> None:
        self._answer_to("hand", request)

    @contextlib.contextmanager
    def works(self, request: Message) -> Iterator[Callable[[], bool]]:
        self._ask("watch", request)
        yield self._gives_up
        self._write({"number": self._number, "question": None})

    def _gives_up(self) -> bool:
        """Raises NotDone where he leaves the step, or the panel is gone."""
        while select.select([sys.stdin], [], [], 0.0)[0]:
            if (answer := self._heard(sys.stdin.readline())) is None:
                raise NotDone(message("bringup.left"))
            if answer is not self:
                return True
        return False

    def _ask(self, kind: str, text: Message) -> None:
        self._number += 1
        self._write({"number": self._number, "question": kind, "text": text})

    @staticmethod
    def _write(what: dict[str, Any]) -> None:
        print(json.dumps(what), flush=True)

    def _answer_to(self, kind: str, text: Message) -> Any:
        """Raises NotDone where he leaves the step, or the panel is gone."""
        self._ask(kind, text)
        while (answer := self._heard(sys.stdin.readline())) is self:
            pass
        if answer is None:
            raise NotDone(message("bringup.left"))
        return answer

    def _heard(self, line: str) -> Any:
        """The answer of a line; ourself where it is one to a question from before."""
        found = json.loads(line) if line else {"number": self._number, "answer": None}
        return found["answer"] if found["number"] == self._number else self


if __name__ == "__main__":
    main()
