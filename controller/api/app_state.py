"""What the panel is made of; every route reaches it by ``access.panel_of``."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path

from controller.api.answers import Refusal
from controller.api.bring_up import BringUp
from controller.api.checker import LONGEST_MEASUREMENT_S, MEASURE_WORKER, Checker, Drafts, Errand
from controller.api.database import StoreError
from controller.api.events import Events
from controller.api.go_on import GoOn
from controller.api.notices import Notices
from controller.api.past import Past
from controller.api.quotas import MAX_UPLOADS, Quota
from controller.api.roles import Control
from controller.api.run_verdicts import RunVerdicts
from controller.api.service_client import ServiceClient, Watch
from controller.api.store import Sizes, Store
from controller.api.ticks import Latest
from controller.api.users import REFRESH_S, Users
from controller.state.record_files import RECORDINGS, RUNS

_log = logging.getLogger(__name__)
AGAIN_S = 1.0  # until a work that failed is begun anew
MAX_NOTES = 1000  # lines of the audit log that wait for the disk
POLL_S = 1.0  # between two looks at programs that came by other ways, and at what was lost


class Panel:
    """Store, users, control token, and the way to the machine."""

    def __init__(
        self,
        store: Store,
        door: ServiceClient,
        checker: Checker | None = None,
        anybody_stops: bool = False,
        by_tls: bool = False,
    ) -> None:
        """``checker``: None where programs are not checked here; ``by_tls``: it does TLS itself, no proxy.

        Raises StoreError.
        """
        self.anybody_stops = anybody_stops  # also who may only look: hold, stop and e-stop
        self.by_tls = by_tls
        self.store, self.checker = store, checker
        self.door = self.watch = Watch(door)
        self.uploading = Quota("upload_many_of_one", MAX_UPLOADS)
        self.drafts = Drafts(store)
        self.saving = asyncio.Lock()  # a back-up
        self.measuring = Errand(MEASURE_WORKER, LONGEST_MEASUREMENT_S)
        self.bring_up = BringUp()
        self.past = Past(store.folder, self.watch)
        self.verdicts = RunVerdicts(store, self.past)
        self.latest = Latest(door)  # ticks for scopes
        self.users = Users(store.users)
        self.sizes = Sizes(store.folder)
        self.control = Control()
        self.events = Events(self.watch, self.past)
        self.notices = Notices(store, self.watch, self.past)
        self.go_on = GoOn(store, self.past, self.door, self.control, self.note)
        self.audited: dict[
            tuple[str, str, bool], float
        ] = {}  # (user, action, allowed) -> when, monotonic (s)
        self._notes: asyncio.Queue[tuple[str, str, str, str, bool]] = asyncio.Queue(MAX_NOTES)

    @property
    def recordings(self) -> Path:
        """A folder per fault, written by the service."""
        return self.store.folder / RECORDINGS

    @property
    def run_records(self) -> Path:
        """A folder per run, written by the service."""
        return self.store.folder / RUNS

    def note(self, user: str, address: str, action: str, detail: str = "", allowed: bool = True) -> None:
        """A line of the audit log; written soon, so that a hold does not wait for the disk."""
        with contextlib.suppress(asyncio.QueueFull):  # the machine goes before its log
            self._notes.put_nowait((user, address, action, detail, allowed))

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """While the application runs: events, users as the command line changes them, the audit log."""
        if self.checker is not None:
            loop = asyncio.get_running_loop()
            self.checker.tell = lambda name: loop.call_soon_threadsafe(self._tell_check, name)
        works = (
            *(self.events.run, self.notices.run, self.go_on.run),
            *((self.verdicts.run,) if self.checker is not None else ()),
            *(self._look, self._refresh_users, self._write_notes),
        )
        tasks = [asyncio.create_task(_run_forever(work)) for work in works]
        try:
            yield
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, self.bring_up.close(), return_exceptions=True)
            await asyncio.to_thread(self._end)

    async def _look(self) -> None:
        while True:
            if self.checker is not None:
                await asyncio.to_thread(self.checker.look)
            with contextlib.suppress(Refusal):  # a service that is away gets it later
                await self._report_losses()
            await asyncio.sleep(POLL_S)

    async def _report_losses(self) -> None:
        if losses := await asyncio.to_thread(lambda: self.store.losses):
            for what in losses:
                await self.door.ask("panel_damaged", **what)
            await asyncio.to_thread(self.store.losses_reported)

    def _tell_check(self, program: str) -> None:
        self.events.tell("programs", {"name": program, "done": "checked"})

    async def _refresh_users(self) -> None:
        while True:
            await asyncio.sleep(REFRESH_S)
            await asyncio.to_thread(self.users.refresh)

    async def _write_notes(self) -> None:
        while True:
            note = await self._notes.get()
            await asyncio.to_thread(self.store.audit.add, *note)

    def _end(self) -> None:
        self.notices.end()
        if self.checker is not None:
            self.checker.close()
        with contextlib.suppress(StoreError):
            self.users.write_sessions()
        with contextlib.suppress(StoreError, asyncio.QueueEmpty):
            while True:
                self.store.audit.add(*self._notes.get_nowait())


async def _run_forever(work: Callable[[], Awaitable[None]]) -> None:
    """Do a work that never ends; neither a store that cannot be used for a while ends it nor a mistake of
    ours, which is in the log: a panel that stands still unseen is worse.
    """
    while True:
        try:
            await work()
        except StoreError:
            pass  # whoever asks for the store is refused
        except Exception:
            _log.exception("A work of the panel's own failed; it is begun anew.")
        await asyncio.sleep(AGAIN_S)
