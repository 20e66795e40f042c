"""A drive's set-up: what of it is kept, what differs from what was kept, and how it is put back.

Kept is every object that can be read and written, but commands, process data and histories.
Put back is only what differs: plain objects first, again where a drive takes one only after
another; then process data in CiA 301's order of remapping (7.5.2.36): off, type, count 0,
entries, count, on. What the drive refuses is told, and the rest is done all the same.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from drives.commissioning import dcf
from drives.commissioning.dcf import Kept, Place, Value
from drives.commissioning.identity import named
from drives.commissioning.network import CommissionError, without_title
from drives.commissioning.remote import Drive
from drives.commissioning.wanted import OFF, RPDO, TPDO
from drives.texts import Message, chain, message

ENABLED_MASK, ENABLED = 0x6F, 0x27  # statusword of operation enabled
DOMAIN = 0x0F
# Why an object is not kept: the end of the key of a text, ``setup.command`` for one.
COMMAND, PROCESS, HISTORY, A_DOMAIN = "command", "process", "history", "domain"
READ_ONLY, WRITE_ONLY = "read_only", "write_only"
LEFT_OUT: tuple[tuple[range, str], ...] = (
    (range(0x1002, 0x1004), HISTORY),
    (range(0x1010, 0x1012), COMMAND),  # store, restore
    (range(0x1012, 0x1014), PROCESS),  # time
    (range(0x1020, 0x1029), COMMAND),  # of configuration tools and operating systems
    (range(0x1F50, 0x1F60), COMMAND),  # program download
    (range(0x6040, 0x6045), PROCESS),  # controlword, statusword, velocity
    (range(0x6060, 0x6062), COMMAND),  # mode of operation: commissioning chooses it
    (range(0x6071, 0x6072), PROCESS),
    (range(0x607A, 0x607B), PROCESS),
    (range(0x60B0, 0x60B3), PROCESS),
    (range(0x60B8, 0x60B9), COMMAND),  # touch probe
    (range(0x60C1, 0x60C2), PROCESS),
    (range(0x60C4, 0x60C5), PROCESS),  # the interpolation's buffer
    (range(0x60FE, 0x6100), PROCESS),  # outputs, target velocity
    (range(0x6200, 0x6300), PROCESS),
    (range(0x6400, 0x6420), PROCESS),
)
COMMUNICATION = (range(0x1400, 0x1C00),)  # process data: parameters and mappings
OUTPUTS_KEPT = ((0x6206, 0x6208),)  # what outputs do in an error is set up, not process
TRIES = 4  # rounds over objects of which one may need another
IDENTIFIERS = frozenset((0x1014,)) | frozenset(range(0x1400, 0x1600)) | frozenset(range(0x1800, 0x1A00))
NODE_BITS = 0x7F
MAKERS = range(0x2000, 0x6000)
ADDRESS = re.compile(r"node[ _-]?(id|address|number)|bit[ _-]?(rate|timing)|baud", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Row:
    """One object that is other than in the file; ``now`` None = it cannot be read."""

    index: int
    sub: int
    name: str
    kept: Value
    now: Value | None
    refused: Message | None = None  # why it is still so

    @property
    def place(self) -> Place:
        return self.index, self.sub


def left_out(index: int, sub: int, access: str, data_type: int) -> str:
    """Why an object is not kept, in a word; "" = it is."""
    if access not in ("rw", "rwr", "rww"):
        return READ_ONLY if access in ("ro", "const") else WRITE_ONLY
    if data_type == DOMAIN:
        return A_DOMAIN
    if any(first <= index < last for first, last in OUTPUTS_KEPT):
        return ""
    if index == 0x60FE and sub == 2:
        return ""  # the mask of the outputs
    return next((why for span, why in LEFT_OUT if index in span), "")


def read(drive: Drive) -> tuple[dict[Place, Value], list[Row]]:
    """What is kept of a drive, and what of it cannot be read. Raises CommissionError where nobody answers."""
    drive.read(0x1000)
    values: dict[Place, Value] = {}
    failed: list[Row] = []
    for entry in dcf.variables(drive.sheet.dictionary):
        if left_out(entry.index, entry.subindex, entry.access_type, entry.data_type or 0):
            continue
        try:
            values[entry.index, entry.subindex] = drive.raw(entry.index, entry.subindex)
        except CommissionError as error:
            failed.append(Row(entry.index, entry.subindex, entry.qualname, "", None, error.said))
    return values, failed


def beside(drive: Drive) -> dict[str, int]:
    """How many objects that can be written are not kept, by the word why."""
    counts: dict[str, int] = {}
    for entry in dcf.variables(drive.sheet.dictionary):
        why = left_out(entry.index, entry.subindex, entry.access_type, entry.data_type or 0)
        if why and entry.writable:
            counts[why] = counts.get(why, 0) + 1
    return counts


def belongs(drive: Drive, kept: Kept) -> None:
    """The file is of such a drive. Raises CommissionError."""
    for sub, words in ((1, kept.vendor), (2, kept.product)):
        if words and drive.has(0x1018, sub) and (found := drive.read(0x1018, sub)) not in words:
            its = chain("or", [f"{word:#x}" for word in words])
            what = message("setup.of_another", **named(sub), found=found, file=kept.name, its=its)
            raise CommissionError(drive.says(what))


def differences(drive: Drive, kept: Kept, address: bool = False) -> Iterator[Row]:
    """What is other than in the file; with ``address`` makers' node ids and bit rates count, too.

    Raises CommissionError where nobody answers.
    """
    drive.read(0x1000)
    for (index, sub), value in _required_settings(drive, kept, address):
        entry = drive.sheet.find(index, sub)
        if entry is None:
            yield Row(index, sub, "", value, None, message("setup.not_in_sheet", sheet=drive.sheet.name))
            continue
        try:
            now = drive.raw(index, sub)
        except CommissionError as error:
            yield Row(index, sub, entry.qualname, value, None, error.said)
            continue
        if now != value:
            yield Row(index, sub, entry.qualname, value, now)


def _required_settings(drive: Drive, kept: Kept, address: bool) -> Iterator[tuple[Place, Value]]:
    """The file's values that are a set-up, for this node id and typed as its sheet types them."""
    for (index, sub), value in sorted(kept.values.items()):
        entry = drive.sheet.find(index, sub)
        access, kind = ("rw", 0) if entry is None else (entry.access_type, entry.data_type or 0)
        if entry is not None and _is_address(index, entry.qualname) and not address:
            continue
        if not left_out(index, sub, access, kind):
            typed = value if entry is None else dcf.signed(entry, value)
            yield (index, sub), _of_node(index, sub, typed, kept.node, drive.settings.node)


def _is_address(index: int, name: str) -> bool:
    """A maker's object that says where on the bus the drive is: known by its name alone."""
    return index in MAKERS and ADDRESS.search(name) is not None


def _of_node(index: int, sub: int, value: Value, before: int | None, now: int) -> Value:
    """An identifier that has the old node id in it gets the new one."""
    named = index in IDENTIFIERS and (sub == 1 or index == 0x1014)
    if before is None or before == now or not named or not isinstance(value, int):
        return value
    return value & ~NODE_BITS | now if value & NODE_BITS == before else value


# --- putting it back ---------------------------------------------------------------------


def see_off(drive: Drive) -> None:
    """Nothing is put back into a drive with torque. Raises CommissionError."""
    if drive.has(0x6041, 0) and drive.read(0x6041) & ENABLED_MASK == ENABLED:
        raise CommissionError(drive.says(message("drive.on_at_set_up")))


def restore(drive: Drive, kept: Kept, address: bool = False) -> list[Row]:
    """Put back what differs and read it again: what differed, ``refused`` None where it is right now.

    The drive must be pre-operational. Raises CommissionError where nobody answers.
    """
    rows = list(differences(drive, kept, address))
    plain = [row for row in rows if not _is_pdo(row.index)]
    refused = _plain(drive, plain)
    values = dict(_required_settings(drive, kept, address))
    for parameters, mapping in _pdos(rows):
        refused |= _pdo(drive, parameters, mapping, values)
    still = {row.place: row for row in differences(drive, kept, address)}
    return [_judged(row, still, refused) for row in rows]


def _judged(row: Row, still: Mapping[Place, Row], refused: Mapping[Place, Message]) -> Row:
    if row.place not in still:
        return row
    why = refused.get(row.place) or still[row.place].refused or message("setup.as_before")
    return Row(row.index, row.sub, row.name, row.kept, row.now, why)


def _is_pdo(index: int) -> bool:
    return any(index in span for span in COMMUNICATION)


def _plain(drive: Drive, rows: Sequence[Row]) -> dict[Place, Message]:
    """Write them, again where one needs another first; what was refused to the last."""
    left = [row for row in rows if row.name]  # what the sheet lacks cannot be written
    refused: dict[Place, Message] = {}
    for _ in range(TRIES):
        refused = {row.place: why for row in left if (why := _put(drive, row.place, row.kept))}
        if not refused or len(refused) == len(left):
            break
        left = [row for row in left if row.place in refused]
    return refused


def _put(drive: Drive, place: Place, value: Value) -> Message | None:
    """Write one object; why it is refused, None: it is not. Raises CommissionError where nobody answers."""
    try:
        drive.put(*place, value)
    except CommissionError as error:
        if not drive.answers():
            raise
        return without_title(error)
    return None


def _pdos(rows: Sequence[Row]) -> list[tuple[int, int]]:
    """Parameters and mapping of every PDO that something differs of."""
    found = set()
    for row in rows:
        for first, mapping, _ in (RPDO, TPDO):
            for base in (first, mapping):
                if base <= row.index < base + 0x200:
                    found.add((first + row.index - base, mapping + row.index - base))
    return sorted(found)


def _pdo(drive: Drive, parameters: int, mapping: int, values: Mapping[Place, Value]) -> dict[Place, Message]:
    """One PDO whole, whatever of it differs; what was refused."""
    refused: dict[Place, Message] = {}

    def put(index: int, sub: int, value: Value | None) -> None:
        entry = drive.sheet.find(index, sub)
        if value is None or entry is None or not entry.writable:
            return
        if why := _put(drive, (index, sub), value):
            refused[index, sub] = why

    identifier = values.get((parameters, 1))
    if identifier is None and drive.has(parameters, 1):
        identifier = drive.read(parameters, 1)
    if isinstance(identifier, int):
        put(parameters, 1, identifier | OFF)
    for (index, sub), value in values.items():
        if index == parameters and sub > 1:
            put(index, sub, value)
    count = values.get((mapping, 0))
    if count is not None:
        put(mapping, 0, 0)
        for sub in range(1, count + 1 if isinstance(count, int) else 1):
            put(mapping, sub, values.get((mapping, sub)))
        put(mapping, 0, count)
    put(parameters, 1, identifier)
    return refused
