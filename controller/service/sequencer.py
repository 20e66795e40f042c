"""What takes long is done one after another, by one thread, and is seen while it is done.

The thread lives as long as the service, so that it may be the parent of processes.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError, ThreadPoolExecutor
from dataclasses import dataclass, replace

from controller import messages
from controller.ipc.control_socket import CommandRefused, Values, own_error
from controller.service.refusals import refused

ANSWER_S = 4.0  # an answer comes so soon, with {"done": false} where the work goes on


@dataclass(frozen=True, slots=True)
class Sequence:
    """What is, or was last, under way; ``state``: "running", "done" or "failed"."""

    name: str
    state: str
    said: messages.Message | None = None  # why it failed

    def to_dict(self) -> Values:
        return {"name": self.name, "state": self.state, **messages.facts(self.said)}


class Going:
    """What is prepared goes out once, or is given up before: one of them comes first, whoever asks when."""

    def __init__(self) -> None:
        self._lock = threading.Lock()  # nobody waits for it longer than a datagram takes
        self.given_up = False

    def give_up(self) -> None:
        """It does not go out any more; what is asked of the tick from here on comes after what did."""
        with self._lock:
            self.given_up = True

    def send(self, out: Callable[[], int]) -> int | None:
        """The number of the request that sets it going; None where it was given up."""
        with self._lock:
            return None if self.given_up else out()


class Sequencer:
    """One piece of work at a time."""

    def __init__(self, failed: Callable[[str, CommandRefused], None]) -> None:
        """``failed`` is called with work that came to nothing, by name."""
        self.now: Sequence | None = None
        self._going: Going | None = None  # of what is under way, where it moves the tool at its end
        self._failed = failed
        self._lock = threading.Lock()
        self._thread = ThreadPoolExecutor(1, "sequencer")

    @property
    def busy(self) -> str:
        """The name of what is under way; "" = nothing."""
        now = self.now
        return now.name if now is not None and now.state == "running" else ""

    def do(
        self,
        name: str,
        work: Callable[[], Values],
        mode: str = "",
        going: Going | None = None,
        behind: str = "",
    ) -> Future[Values]:
        """Begin; the future gives the result, {"done": false} after a while. Raises CommandRefused if busy.

        ``going``: by what it can be given up before it moves anything; ``behind``: the name of what may be
        under way, as it was given up and comes to its end.
        """
        return _patient(self._begin(name, work, mode, going, behind))

    def give_up(self) -> str:
        """What is under way moves nothing any more, if it has not begun to; its name, "" = nothing was."""
        with self._lock:
            name, going = self.busy, self._going
        if not name or going is None:
            return ""
        going.give_up()
        return name

    def to_its_end(self, name: str, work: Callable[[], Values]) -> Values:
        """Begin, and wait for the result, however long it takes. Raises CommandRefused."""
        return self._begin(name, work, "").result()

    def _begin(
        self, name: str, work: Callable[[], Values], mode: str, going: Going | None = None, behind: str = ""
    ) -> Future[Values]:
        with self._lock:
            if (other := self.busy) and other != behind:
                raise refused("under_way", mode, name.upper(), "busy", other=other)
            self.now = one = Sequence(name, "running")
            self._going = going
            return self._thread.submit(self._run, one, work)

    def later(self, work: Callable[[], None]) -> None:
        """After whatever is under way, and reported to nobody."""
        self._thread.submit(work)

    def wait(self) -> None:
        """Until all is done; nothing more is taken."""
        self._thread.shutdown(wait=True)

    def _run(self, one: Sequence, work: Callable[[], Values]) -> Values:
        try:
            result = work()
        except Exception as error:
            known = error if isinstance(error, CommandRefused) else own_error(error)
            self._ended(one, replace(one, state="failed", said=known.said))
            self._failed(one.name, known)
            raise known from error
        self._ended(one, replace(one, state="done"))
        return {"done": True, **result}

    def _ended(self, one: Sequence, so: Sequence) -> None:
        """What has begun after it is what is under way."""
        with self._lock:
            if self.now is one:
                self.now = so


def _patient(work: Future[Values]) -> Future[Values]:
    answer: Future[Values] = Future()
    impatient = threading.Timer(ANSWER_S, _answer, (answer, {"done": False}))
    impatient.daemon = True
    impatient.start()

    def done(finished: Future[Values]) -> None:
        impatient.cancel()
        error = finished.exception()
        with contextlib.suppress(InvalidStateError):
            if error is None:
                answer.set_result(finished.result())
            else:
                answer.set_exception(error)

    work.add_done_callback(done)
    return answer


def _answer(answer: Future[Values], result: Values) -> None:
    with contextlib.suppress(InvalidStateError):
        answer.set_result(result)
