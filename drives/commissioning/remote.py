"""One node during commissioning: reads and writes over SDO, with sentences for errors."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Sequence
from dataclasses import field
from typing import Any

from canopen import ObjectDictionaryError
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from drives import pdo
from drives.arranged import Arranged
from drives.commissioning import sheet
from drives.commissioning.network import CommissionError, Network, Node
from drives.commissioning.values import told
from drives.commissioning.wanted import Setting, Step
from drives.texts import Said, said
from drives.values import dataclass

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
    why: str


@dataclass(slots=True)
class Outcome:
    """What commissioning did to one node."""

    name: str
    node: int
    changes: list[Change] = field(default_factory=list)
    already_so: int = 0  # objects that were right before
    stored: bool = False
    arranged: Arranged | None = None  # its units, and how it stops; of drives only
    warnings: list[str] = field(default_factory=list)  # what was accepted all the same


class Drive:
    """One node; ``settings`` say where it is and what data sheet it has."""

    def __init__(self, network: Network, settings: Node) -> None:
        self._network = network
        self.settings = settings
        self._node = network.join(settings)
        self.sheet = sheet.of(settings)
        self.outcome = Outcome(settings.name, settings.node)

    @property
    def title(self) -> str:
        return f"drive {self.settings.name} (node {self.settings.node})"

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
            raise CommissionError(
                said("drive.no_object_to_read", title=self.title, eds=self.settings.eds, index=index, sub=sub)
            )
        try:
            return int(self._variable(index, sub).raw)
        except SdoAbortedError as error:
            kind = MissingObjectError if error.code in MISSING else RefusedError
            raise kind(said("drive.not_read", title=self.title, index=index, sub=sub, why=error)) from error
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

    def offer(self, setting: Setting, at_least: bool = False) -> tuple[int | None, str]:
        """Write what the drive may refuse, unless it is so: what it has then, and why it is not as offered.

        ``at_least``: more is as good. None: it has no such object, or keeps it to itself. Raises
        CommissionError for silence.
        """
        try:
            before = self.find(*setting.place)
        except RefusedError as error:
            return None, f"{setting.where} cannot be read ({error.__cause__})"
        if before is None or before == setting.value or (at_least and before > setting.value):
            self.outcome.already_so += before is not None
            return before, ""
        wanted = told(*setting.place, setting.value)
        if not self.sheet.writable(*setting.place):
            return before, f"{setting.where} is read only and reads {told(*setting.place, before)}"
        try:
            self._variable(*setting.place).raw = setting.value
        except SdoAbortedError as error:
            reads = told(*setting.place, before)
            return before, f"{setting.where} refuses {wanted} ({error}), reads {reads}"
        except SdoCommunicationError as error:
            raise CommissionError(self._silent(*setting.place)) from error
        except MISFITS as error:
            raise CommissionError(self._misfit(*setting.place, error)) from error
        found = self.read(*setting.place)
        if found != before:
            self.outcome.changes.append(Change(*setting.place, before, found, setting.why))
        differs = found < setting.value if at_least else found != setting.value
        reads = told(*setting.place, found)
        return found, f"{setting.where} was set to {wanted}, reads {reads}" if differs else ""

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
            reason = str(error).removeprefix(f"{self.title}: ")
            self.outcome.warnings.append(f"{reason}; accepted with unsupervised = true")

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
                did = "is read only and must be" if fixed else "was set to"
                raise RefusedError(
                    f"{self.title}: {setting.where} {did} {told(*setting.place, setting.value)} but reads"
                    f" {told(*setting.place, found)}; {setting.why}; check that the drive supports this value"
                )
            if was is not None and _agrees(was, setting):
                self.outcome.already_so += 1
                return
        self.outcome.changes.append(Change(setting.index, setting.sub, was, setting.value, setting.why))

    def _known(self, setting: Setting) -> bool:
        """Whether the drive has it; what it must have and has not is a CommissionError."""
        if self.has(setting.index, setting.sub):
            return True
        if setting.optional:
            return False
        raise CommissionError(
            f"{self.title}: its data sheet {self.settings.eds} has no {setting.where}, but {setting.why};"
            " a drive without it cannot be used here"
        )

    def _readable(self, setting: Setting) -> bool:
        found = self.sheet.find(setting.index, setting.sub)
        return found is not None and found.readable

    def put(self, index: int, sub: int, value: int | float | str | bytes) -> None:
        """Download as the data sheet types it, and no more. Raises CommissionError."""
        try:
            self._send(index, sub, value)
        except SdoAbortedError as error:
            what = told(index, sub, value) if isinstance(value, int) else str(value)
            raise RefusedError(
                f"{self.title}: object {index:04X}h:{sub:02X} refuses {what}: {error}"
            ) from error

    def _download(self, setting: Setting) -> None:
        try:
            self._send(setting.index, setting.sub, setting.value)
        except SdoAbortedError as error:
            raise RefusedError(
                f"{self.title}: {setting.where} refuses {told(*setting.place, setting.value)}: {error};"
                f" {setting.why}; choose a value the drive supports"
            ) from error

    def _send(self, index: int, sub: int, value: int | float | str | bytes) -> None:
        """Raises SdoAbortedError, and CommissionError for all else."""
        try:
            self._variable(index, sub).raw = value
        except SdoCommunicationError as error:
            raise CommissionError(self._silent(index, sub)) from error
        except MISFITS as error:
            raise CommissionError(self._misfit(index, sub, error)) from error

    def _misfit(self, index: int, sub: int, error: Exception) -> Said:
        reason = " ".join(str(error).split())
        return said(
            "drive.not_as_sheet", title=self.title, index=index, sub=sub, eds=self.settings.eds, reason=reason
        )

    def _silent(self, index: int, sub: int) -> Said:
        return said(
            "drive.silent", title=self.title, index=index, sub=sub, patience_s=self._network.patience_s
        )

    def _variable(self, index: int, sub: int) -> Any:
        entry = self._node.sdo[index]
        return entry[sub] if hasattr(entry, "__getitem__") else entry

    def raw(self, index: int, sub: int) -> int | float | str | bytes:
        """Any object as the data sheet types it. Raises CommissionError."""
        try:
            value: int | float | str | bytes = self._variable(index, sub).raw
        except SdoAbortedError as error:
            raise CommissionError(str(error)) from error
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
        why = f"mode {mode} is needed"
        self._download(Setting(0x6060, 0, mode, why))
        if not self._network.wait(lambda: self.read(0x6061) == mode):
            raise CommissionError(
                said("drive.mode_not_taken", title=self.title, mode=mode, shown=self.read(0x6061))
            )
        self.outcome.changes.append(Change(0x6060, 0, was, mode, why))

    def store(self) -> None:
        """Have the drive keep all parameters (1010h:01). Raises CommissionError."""
        if not self.has(0x1010, 1):
            raise CommissionError(said("drive.no_store", title=self.title))
        patience_s, self._network.patience_s = self._network.patience_s, STORE_S
        try:
            self._download(Setting(0x1010, 1, SAVE, "settings are to be kept"))
        finally:
            self._network.patience_s = patience_s
        self.outcome.stored = True


def _agrees(found: int, setting: Setting) -> bool:
    return not (found ^ setting.value) & setting.mask
