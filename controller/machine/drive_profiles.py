"""TOML to ``Profile``: what a family of drives can do and how it is commissioned.

``load(name_or_path)`` is the verb. A profile file has one table ``[drive]``, for what else a
drive must be told ``[[write]]`` tables, for makers' objects with the counts of a revolution
``[[encoder_resolution]]``, and ``[[override]]`` tables where its data sheets are wrong;
``config/drives`` holds the shipped ones.
Every refusal is a ``ConfigError`` in the form of ``toml_table``, and no key goes unread.

What is told with every commissioning (``quirks``, ``why``, ``reason``) are words of whoever writes the file,
and shown as they are. The shipped ones name texts of the catalogue instead, for every language:
``quirks = [{ text = "profile.elmo.pdos_fixed" }]``.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from controller.machine.declaration import key
from controller.machine.forms import FLAG, TEXT, Choice, Integer, Own
from controller.machine.reading import Reading, Rules, read_alone
from controller.machine.toml_table import ConfigError, Table, is_number, parse, read_text
from controller.messages import DEFAULT, LANGUAGES, Key, message
from drives.profile import CyclicMode, Encoder, Override, Profile, Supervision, Write
from drives.text_file import Source, TextFile

# Objects of drives as TOML tables name them: ``"2210:01"``, and where a data sheet is wrong about one.
#
#     [[override]]                # of a profile; in a machine file [[axis.override]]
#     object = "1016:01"
#     high = 0xFFFFFFFF           # or low, access, default, mappable, type
#     reason = "node << 16 | ms does not fit the sheet's 65535; firmware 1.1.15 takes it"
#
# Every refusal is a ``ConfigError`` in the form of ``toml_table``.

OBJECT = Key("file.may.object")
ACCESS = ("ro", "wo", "rw", "rwr", "rww", "const")  # CiA 306-1, AccessType
TYPES = {  # CiA 301, 7.4.7.1
    "INTEGER8": 0x02,
    "INTEGER16": 0x03,
    "INTEGER32": 0x04,
    "UNSIGNED8": 0x05,
    "UNSIGNED16": 0x06,
    "UNSIGNED32": 0x07,
}
WHAT = ("low", "high", "access", "default", "mappable", "type")
MIN_INTEGER, MAX_INTEGER = -(2**31), 2**32 - 1  # of any integer up to 32 bits


def object_index(text: str) -> int | None:
    """1000h .. FFFFh of "60F4"; None for anything else."""
    try:
        found = int(text, 16)
    except ValueError:
        return None
    return found if len(text) == 4 and 0x1000 <= found <= 0xFFFF else None


def place(table: Table) -> tuple[int, int]:
    """Index and sub-index of ``object = "2210:01"``. Raises ConfigError."""
    first, _, sub = table.text("object").partition(":")
    number = object_index(first)
    if number is None or not (sub == "" or (len(sub) == 2 and set(sub.upper()) <= set("0123456789ABCDEF"))):
        table.refuse("object", "no_place", object=OBJECT)
    return number, int(sub or "0", 16)


def overrides(table: Table) -> tuple[Override, ...]:
    """The ``[[override]]`` tables of a profile, none or more. Raises ConfigError."""
    return tuple(read_alone(OverrideTable, entry, RULES) for entry in table.tables("override"))


_SIZE = Integer(MIN_INTEGER, MAX_INTEGER)
WORDS = Own(
    lambda here, name: words(here.table, name), message("file.may.text"), {"type": ["string", "object"]}
)


@dataclass(frozen=True, slots=True, kw_only=True)
class OverrideTable:
    """``[[override]]`` as it is written."""

    object: str = key(TEXT, 'of the drive, as `"2210:01"`')
    low: int | None = key(_SIZE, "least value that it really takes", default=None)
    high: int | None = key(_SIZE, "largest value that it really takes", default=None)
    access: str | None = key(Choice(ACCESS), "as the drive really has it", default=None)
    default: int | None = key(_SIZE, "its value after power-on", default=None)
    mappable: bool | None = key(FLAG, "whether a PDO takes it", default=None)
    type: int | None = key(Choice(TYPES), "of an object that the sheet lacks", default=None)
    reason: str = key(
        WORDS,
        "who says so; it is told with every commissioning",
    )


def _check_override(here: Reading) -> None:
    place(here.table)
    if not any(here.table.holds(key) for key in WHAT):
        here.table.refuse("object", "override_empty", known=", ".join(WHAT))


def _check_reason(here: Reading) -> None:
    if not here["reason"]:
        here.table.refuse("reason", "reason_empty")


def _check_ends(here: Reading) -> None:
    if here["low"] is not None and here["high"] is not None and here["low"] > here["high"]:
        here.table.refuse("low", "low_above", high=here["high"])


def _override(table: OverrideTable, here: Reading) -> Override:
    return Override(
        *place(here.table),
        reason=table.reason,
        low=table.low,
        high=table.high,
        access=table.access,
        default=table.default,
        mappable=table.mappable,
        data_type=table.type,
    )


RULES: Mapping[type, Rules] = {
    OverrideTable: Rules(checks=(_check_override, _check_reason, _check_ends), made=_override)
}


TEXTS = frozenset(key for key in LANGUAGES[DEFAULT].texts if key.startswith("profile."))


def words(table: Table, key: str) -> str:
    """What a profile says to whoever reads it: a text, or one of the catalogue. Raises ConfigError."""
    value = table.get(key, message("file.may.text"))
    return _named(table, key, value) if isinstance(value, dict) else table.text(key).strip()


def _named(table: Table, key: str, value: Mapping[str, Any]) -> Key:
    """A text of the catalogue, by ``{ text = "profile.elmo.pdos_fixed" }``."""
    named = str(value.get("text"))
    if len(value) != 1 or named not in TEXTS:
        table.refuse(key, "no_such_text")
    return Key(named)


SHIPPED = Path(__file__).resolve().parent.parent.parent / "config" / "drives"
MODES = {"csp": CyclicMode.CSP, "ip": CyclicMode.IP}
NONE = "none"  # TOML has no null
LAST_PDO = 4  # numbers with a pre-defined identifier (CiA 301, 7.3.5)
GENERAL = Profile()


def load(source: Source) -> Profile:
    """The profile of a file, or of a shipped file by its name ("maxon_epos4").

    The name of a file that is not shipped is its path. Raises ``ConfigError``.
    """
    return _load(source if isinstance(source, TextFile) else str(source))


@cache
def shipped() -> tuple[str, ...]:
    """Names of the profiles that come with Directrix, for ``load``."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.toml")))


@lru_cache(maxsize=64)
def _load(source: str | TextFile) -> Profile:
    if isinstance(source, TextFile):
        return read(source.text, source.name, Path(), source.name, source.sheet)
    path = profile_file(source, SHIPPED)
    name = path.stem if path.parent == SHIPPED else source
    return read(read_text(path), path.name, path.parent, name)


def profile_file(source: str, folder: Path) -> Path:
    """The file of a profile by its path, or by its name in ``folder``. Raises ConfigError."""
    path = Path(source) if source.endswith(".toml") else folder / f"{source}.toml"
    if path.is_file():
        return path
    known = sorted(one.stem for one in folder.glob("*.toml"))
    near = difflib.get_close_matches(source, known, n=1)
    do = message("file.mean", near=near[0]) if near else message("file.name_profile")
    raise ConfigError(message("file.no_profile", source=source, allowed=", ".join(known), do=do))


def read(text: str, file: str, folder: Path, name: str, sheet: TextFile | None = None) -> Profile:
    """The profile of a text; its data sheet is looked for from ``folder``. Raises ``ConfigError``."""
    top = parse(text, file)
    table = top.table("drive", "[drive]")
    shortest_s, longest_s = _period(table)
    profile = Profile(
        name=name,
        eds=_eds(table, folder, sheet),
        mode=MODES[table.text("mode", tuple(MODES), "csp")],
        rpdo=table.integer("rpdo", 1, LAST_PDO, GENERAL.rpdo),
        tpdo=table.integer("tpdo", 1, LAST_PDO, GENERAL.tpdo),
        command_rpdo=table.integer("command_rpdo", 1, LAST_PDO, GENERAL.command_rpdo),
        takes_feed_forward=table.flag("feed_forward", GENERAL.takes_feed_forward),
        most_feedback_every=table.integer("most_feedback_every", 1, 240, GENERAL.most_feedback_every),
        period_exponents=_integers(table, "period_exponents", -6, -1, GENERAL.period_exponents),
        period_step_s=table.positive("period_step_ms", GENERAL.period_step_s * 1e3) / 1e3,
        period_min_s=shortest_s,
        period_max_s=longest_s,
        supervision=Supervision(table.text("supervision", [s.value for s in Supervision])),
        quick_stop_code=_code(table, "quick_stop_code", 0, 8, GENERAL.quick_stop_code),
        abort_code=_code(table, "abort_code", 0, 3, GENERAL.abort_code),
        error_behaviour=_code(table, "error_behaviour", 0, 2, GENERAL.error_behaviour),
        most_following_error=table.integer(
            "most_following_error", 1, 0xFFFF_FFFF, GENERAL.most_following_error
        ),
        homing_methods=_integers(table, "homing_methods", -128, 127, GENERAL.homing_methods),
        home_offset=_home_offset(table),
        vendor=table.integer("vendor", 1, 0xFFFF_FFFF) if table.has("vendor") else None,
        product=table.integer("product", 1, 0xFFFF_FFFF) if table.has("product") else None,
        optional=_objects(table, "optional"),
        writes=tuple(_write(entry) for entry in top.tables("write")),
        velocity_unit_counts_s=table.positive_or_none("velocity_unit_counts_s") or 0.0,
        acceleration_unit_counts_s2=table.positive_or_none("acceleration_unit_counts_s2") or 0.0,
        revolution=table.text("revolution", ("motor", "shaft"), GENERAL.revolution),
        encoder_resolution=tuple(_encoder(entry) for entry in top.tables("encoder_resolution")),
        overrides=overrides(top),
        quirks=_quirks(table),
    )
    _audit(profile, table)
    table.finish()
    top.finish()
    return profile


def _audit(profile: Profile, table: Table) -> None:
    """What only the whole table can show."""
    if profile.takes_feed_forward and profile.rpdo == profile.command_rpdo:
        table.refuse("command_rpdo", "command_taken", rpdo=profile.rpdo)
    if profile.acceleration_unit_counts_s2 and not profile.velocity_unit_counts_s:
        table.refuse("acceleration_unit_counts_s2", "unit_alone")
    if profile.mode is CyclicMode.IP and profile.takes_feed_forward:
        table.refuse("feed_forward", "forward_of_ip")


def _eds(table: Table, folder: Path, sheet: TextFile | None) -> Source:
    """The data sheet, absolute or as it came along; "" where the maker of the drive keeps it."""
    name = table.text("eds", default="")
    if sheet is not None:
        return sheet
    path = (folder / name).resolve()
    if name and not path.is_file():
        table.refuse("eds", "no_sheet_file", path=path)
    return str(path) if name else ""


def _period(table: Table) -> tuple[float, float]:
    default = (GENERAL.period_min_s * 1e3, GENERAL.period_max_s * 1e3)
    shortest_ms, longest_ms = table.numbers("period_ms", 2, default)
    if not 0.0 < shortest_ms <= longest_ms:
        table.refuse("period_ms", "no_period")
    return shortest_ms / 1e3, longest_ms / 1e3


def _code(table: Table, key: str, lower: int, upper: int, default: int | None) -> int | None:
    """An option code, or "none" for a drive that has no such object."""
    if table.has(key) and table.get(key, "") == NONE:
        return None
    return table.integer(key, lower, upper, default) if table.has(key) or default is not None else None


def _integers(table: Table, key: str, lower: int, upper: int, default: tuple[int, ...]) -> tuple[int, ...]:
    allowed = message("file.may.integers", lower=lower, upper=upper)
    values = table.get(key, allowed, default)
    sound = isinstance(values, list | tuple) and values and all(type(v) is int for v in values)
    if not sound or not all(lower <= value <= upper for value in values):
        table.refuse(key, "no_such_list", allowed=allowed)
    return tuple(values)


def _quirks(table: Table) -> tuple[str, ...]:
    values = table.get("quirks", message("file.may.texts"), ())
    if isinstance(values, list):
        values = [_named(table, "quirks", one) if isinstance(one, dict) else one for one in values]
    return _texts(table, "quirks", values)


def _texts(table: Table, key: str, values: Any) -> tuple[str, ...]:
    if not isinstance(values, list | tuple) or not all(isinstance(v, str) for v in values):
        table.refuse(key, "no_texts")
    return tuple(values)


def _objects(table: Table, key: str) -> tuple[int, ...]:
    values = _texts(table, key, table.get(key, message("file.may.texts"), ()))
    found = tuple(map(object_index, values))
    if None in found:
        table.refuse(key, "no_objects", object=OBJECT)
    return tuple(index for index in found if index is not None)


def _home_offset(table: Table) -> int | None:
    text = table.text("home_offset", default="607C")
    if text == NONE:
        return None
    index = object_index(text)
    if index is None:
        table.refuse("home_offset", "no_object", object=OBJECT)
    return index


def _encoder(table: Table) -> Encoder:
    """``object = "3000:05"`` that tells counts, or with ``times = 4`` pulses, of a revolution."""
    found = Encoder(*place(table), table.integer("times", 1, 1024, 1))
    table.finish()
    return found


def _write(table: Table) -> Write:
    """``object = "2210:01"``, its value, and why it is needed (the end of a sentence)."""
    where = place(table)
    value = table.get("value", message("file.may.whole"))
    if not is_number(value) or type(value) is not int:
        table.refuse("value", "not_whole")
    write = Write(*where, value, words(table, "why"))
    table.finish()
    return write
