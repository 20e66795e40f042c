"""One node during commissioning: reads and writes over SDO, with sentences for errors."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from canopen import ObjectDictionaryError
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from drives import pdo
from drives.arranged import Arranged
from drives.commissioning import sheet
from drives.commissioning.network import CommissionError, Network, Node, of_drive, title, without_title
from drives.commissioning.values import in_words
from drives.commissioning.wanted import Setting, Step, where
from drives.texts import Key, Message, message, plain

NMT_START, NMT_PRE_OPERATIONAL = 0x01, 0x80
BOOT_TRIES, BOOT_TRY_S = 20, 0.1  # a drive may be starting up when we look for it
SAVE = 0x6576_6173  # "save", 1010h
MISSING = (0x0602_0000, 0x0609_0011)  # abort codes: no such object, no such sub-index
# What canopen raises where an answer is not of the type that the data sheet gives the object.
MISFITS = (ObjectDictionaryError, struct.error, ValueError, TypeError, AttributeError, KeyError)
STORE_S = 5.0  # a drive may be silent while it writes its memory


class RefusedError(CommissionError):
    """The drive answers, and does not let an object be read, or written, or does not keep a value."""


class MissingObjectError(RefusedError):
    """The drive does not have an object that its data sheet has."""


@dataclass(frozen=True, slots=True)
class Change:
    """An object that was not as it must be, and is now."""

    index: int
    sub: int
    was: int | None  # None: it cannot be read
    now: int
    why: Message


@dataclass(slots=True)
class Outcome:
    """What commissioning did to one node."""

    name: str
    node: int
    changes: list[Change] = field(default_factory=list)
    already_so: int = 0  # objects that were right before
    stored: bool = False
    arranged: Arranged | None = None  # its units, and how it stops; of drives only
    warnings: list[Message] = field(default_factory=list)  # what was accepted all the same


class Drive:
    """One node; ``settings`` say where it is and what data sheet it has."""

    def __init__(self, network: Network, settings: Node) -> None:
        self._network = network
        self.settings = settings
        self._node = network.join(settings)
        self.sheet = sheet.of(settings)
        self.outcome = Outcome(settings.name, settings.node)

    @property
    def title(self) -> Message:
        return title(self.settings)

    def says(self, what: Message) -> Message:
        """What is said of this drive."""
        return of_drive(self.settings, what)

    def answers(self, tries: int = 1) -> bool:
        """Whether anybody is there at this moment."""
        patience_s, self._network.patience_s = self._network.patience_s, BOOT_TRY_S
        try:
            for _ in range(tries):
                with contextlib.suppress(CommissionError):
                    self.read(0x1000)
                    return True
        finally:
            self._network.patience_s = patience_s
        return False

    def meet(self) -> None:
        """Wait until the drive answers at all. Raises CommissionError."""
        if not self.answers(BOOT_TRIES):
            self.read(0x1000)

    def has(self, index: int, sub: int) -> bool:
        """Whether the data sheet knows the object."""
        return self.sheet.has(index, sub)

    def command(self, nmt: int) -> None:
        """An NMT command to this node."""
        self._network.send_message(pdo.NMT, bytes([nmt, self.settings.node]))

    def read(self, index: int, sub: int = 0) -> int:
        """Upload. Raises CommissionError."""
        if not self.has(index, sub):
            eds = self.settings.eds
            raise CommissionError(
                self.says(message("drive.no_object_to_read", eds=eds, index=index, sub=sub))
            )
        try:
            return int(self._variable(index, sub).raw)
        except SdoAbortedError as error:
            kind = MissingObjectError if error.code in MISSING else RefusedError
            what = message("drive.not_read", index=index, sub=sub, why=_aborted(error))
            raise kind(self.says(what)) from error
        except SdoCommunicationError as error:
            raise CommissionError(self._silent(index, sub)) from error
        except MISFITS as error:
            raise CommissionError(self._misfit(index, sub, error)) from error

    def find(self, index: int, sub: int = 0) -> int | None:
        """Upload of what a drive may do without: None where it has no such object. Raises CommissionError."""
        found = self.sheet.find(index, sub)
        if found is None or not found.readable:
            return None
        try:
            return self.read(index, sub)
        except MissingObjectError:
            return None

    def offer(self, setting: Setting, at_least: bool = False) -> tuple[int | None, Message | None]:
        """Write what the drive may refuse, unless it is so: what it has then, and why it is not as offered.

        ``at_least``: more is as good. None: it has no such object, or keeps it to itself. Raises
        CommissionError for silence.
        """
        place, at = setting.place, {"where": setting.where}
        try:
            before = self.find(*place)
        except RefusedError as error:
            return None, message("drive.cannot_be_read", **at, why=_aborted(error.__cause__))
        if before is None or before == setting.value or (at_least and before > setting.value):
            self.outcome.already_so += before is not None
            return before, None
        wanted, reads = in_words(*place, setting.value), in_words(*place, before)
        if not self.sheet.writable(*place):
            return before, message("drive.reads_fixed", **at, reads=reads)
        try:
            self._variable(*place).raw = setting.value
        except SdoAbortedError as error:
            return before, message(
                "drive.offer_refused", **at, wanted=wanted, why=_aborted(error), reads=reads
            )
        except SdoCommunicationError as error:
            raise CommissionError(self._silent(*place)) from error
        except MISFITS as error:
            raise CommissionError(self._misfit(*place, error)) from error
        found = self.read(*place)
        if found != before:
            self.outcome.changes.append(Change(*place, before, found, plain(setting.why)))
        if found >= setting.value if at_least else found == setting.value:
            return found, None
        return found, message("drive.set_and_reads", **at, wanted=wanted, reads=in_words(*place, found))

    def write(self, setting: Setting) -> None:
        """Download and read back, unless it is so already. Raises CommissionError."""
        self.apply(Step((setting,)))

    def apply(self, step: Step) -> None:
        """Write what belongs together and read it back, unless all of it is so. Raises CommissionError.

        A drive that does not take what is waived is warned of.
        """
        try:
            self._apply(step)
        except RefusedError as error:
            if not all(setting.waived for setting in step.settings):
                raise
            self.outcome.warnings.append(message("drive.accepted", why=without_title(error)))

    def _apply(self, step: Step) -> None:
        outcome = [setting for setting in step.outcome if self._known(setting)]
        before = self._before([setting for setting in outcome if self._readable(setting)])
        missing = [setting.place for setting in outcome if before.get(setting.place, 0) is None]
        outcome = [setting for setting in outcome if setting.place not in missing]
        readable = [setting for setting in outcome if setting.place in before]
        if all(_agrees(before[setting.place] or 0, setting) for setting in readable) and (
            readable or missing
        ):
            self.outcome.already_so += len(outcome)
            return
        for setting in step.settings:
            writable = self.sheet.writable(setting.index, setting.sub)
            if setting.place not in missing and self._known(setting) and writable:
                self._download(setting)
        for setting in outcome:
            self._confirm(setting, before.get(setting.place))

    def _before(self, settings: Sequence[Setting]) -> dict[tuple[int, int], int | None]:
        """What is there now; None for what the data sheet has, the drive has not, and may do without."""
        found: dict[tuple[int, int], int | None] = {}
        for setting in settings:
            try:
                found[setting.place] = self.read(setting.index, setting.sub)
            except MissingObjectError:
                if setting.waived or not setting.optional:
                    raise
                found[setting.place] = None
        return found

    def _confirm(self, setting: Setting, was: int | None) -> None:
        if self._readable(setting):
            found = self.read(setting.index, setting.sub)
            if not _agrees(found, setting):
                fixed = not self.sheet.writable(setting.index, setting.sub)
                values = (in_words(*setting.place, value) for value in (setting.value, found))
                facts = dict(zip(("wanted", "reads"), values, strict=True))
                key = "drive.fixed_otherwise" if fixed else "drive.reads_otherwise"
                what = message(key, where=setting.where, **facts, need=setting.why)
                raise RefusedError(self.says(what))
            if was is not None and _agrees(was, setting):
                self.outcome.already_so += 1
                return
        self.outcome.changes.append(Change(*setting.place, was, setting.value, plain(setting.why)))

    def _known(self, setting: Setting) -> bool:
        """Whether the drive has it; what it must have and has not is a CommissionError."""
        if self.has(setting.index, setting.sub):
            return True
        if setting.optional:
            return False
        facts = {"eds": self.settings.eds, "where": setting.where, "need": setting.why}
        raise CommissionError(self.says(message("drive.no_such_object", **facts)))

    def _readable(self, setting: Setting) -> bool:
        found = self.sheet.find(setting.index, setting.sub)
        return found is not None and found.readable

    def put(self, index: int, sub: int, value: int | float | str | bytes) -> None:
        """Download as the data sheet types it, and no more. Raises CommissionError."""
        try:
            self._send(index, sub, value)
        except SdoAbortedError as error:
            words = in_words(index, sub, value) if isinstance(value, int) else str(value)
            what = message("drive.refuses", where=where(index, sub), value=words, why=_aborted(error))
            raise RefusedError(self.says(what)) from error

    def _download(self, setting: Setting) -> None:
        try:
            self._send(setting.index, setting.sub, setting.value)
        except SdoAbortedError as error:
            value, facts = (
                in_words(*setting.place, setting.value),
                {"where": setting.where, "need": setting.why},
            )
            what = message("drive.refuses_needed", **facts, value=value, why=_aborted(error))
            raise RefusedError(self.says(what)) from error

    def _send(self, index: int, sub: int, value: int | float | str | bytes) -> None:
        """Raises SdoAbortedError, and CommissionError for all else."""
        try:
            self._variable(index, sub).raw = value
        except SdoCommunicationError as error:
            raise CommissionError(self._silent(index, sub)) from error
        except MISFITS as error:
            raise CommissionError(self._misfit(index, sub, error)) from error

    def _misfit(self, index: int, sub: int, error: Exception) -> Message:
        reason = " ".join(str(error).split())
        facts = {"index": index, "sub": sub, "eds": self.settings.eds, "reason": reason}
        return self.says(message("drive.not_as_sheet", **facts))

    def _silent(self, index: int, sub: int) -> Message:
        patience_s = self._network.patience_s
        return self.says(message("drive.silent", index=index, sub=sub, patience_s=patience_s))

    def _variable(self, index: int, sub: int) -> Any:
        entry = self._node.sdo[index]
        return entry[sub] if hasattr(entry, "__getitem__") else entry

    def raw(self, index: int, sub: int) -> int | float | str | bytes:
        """Any object as the data sheet types it. Raises CommissionError."""
        try:
            value: int | float | str | bytes = self._variable(index, sub).raw
        except SdoAbortedError as error:
            raise CommissionError(_aborted(error)) from error
        except SdoCommunicationError as error:
            raise CommissionError(self._silent(index, sub)) from error
        except MISFITS as error:
            raise CommissionError(self._misfit(index, sub, error)) from error
        return value

    def set_mode(self, mode: int) -> None:
        """Mode of operation, 6060h, and wait until 6061h shows it. Raises CommissionError."""
        was = self.read(0x6061)
        if was == mode:
            self.outcome.already_so += 1
            return
        why = message("setting.needed_mode", mode=mode)
        self._download(Setting(0x6060, 0, mode, why))
        if not self._network.wait(lambda: self.read(0x6061) == mode):
            what = message("drive.mode_not_taken", mode=mode, shown=self.read(0x6061))
            raise CommissionError(self.says(what))
        self.outcome.changes.append(Change(0x6060, 0, was, mode, why))

    def store(self) -> None:
        """Have the drive keep all parameters (1010h:01). Raises CommissionError."""
        if not self.has(0x1010, 1):
            raise CommissionError(self.says(message("drive.no_store")))
        patience_s, self._network.patience_s = self._network.patience_s, STORE_S
        try:
            self._download(Setting(0x1010, 1, SAVE, message("setting.to_keep")))
        finally:
            self._network.patience_s = patience_s
        self.outcome.stored = True


def _agrees(found: int, setting: Setting) -> bool:
    return not (found ^ setting.value) & setting.mask


def _aborted(error: BaseException | None) -> Message:
    """Why a drive refused (CiA 301, 7.2.4.3.17)."""
    if not isinstance(error, SdoAbortedError):
        return plain(str(error))
    if error.code not in SdoAbortedError.CODES:
        return message("abort.unknown", code=error.code)
    return message("abort.code", code=error.code, what=Key(f"abort.{error.code:08X}"))
