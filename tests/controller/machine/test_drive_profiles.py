"""Drive profiles: TOML in, ``Profile`` out; every slip is one sentence with file, table and key."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.machines.spindle_machine import without_spindle

from controller import messages
from controller.machine import drive_profiles, inverter_profiles, machine_file, nodes
from controller.machine.toml_table import ConfigError, parse
from controller.messages import LANGUAGES, Key
from drives.profile import CyclicMode, Override, Supervision, Write

LEAST = '[drive]\nsupervision = "heartbeat"\n'


def read(text: str, folder: Path = Path()) -> object:
    return drive_profiles.read(text, "mine.toml", folder, "mine")


@pytest.mark.parametrize("name", drive_profiles.shipped())
def test_a_shipped_profile_is_read_whole_and_bears_its_name(name: str) -> None:
    assert drive_profiles.load(name).name == name


def test_nine_families_are_shipped() -> None:
    families = {"elmo", "elmo_gold", "generic", "maxon_epos4", "nanotec_c5e", "pilz_prbt", "simulated"}
    families |= {"technosoft_ipos", "trinamic_tmcm1636"}
    assert set(drive_profiles.shipped()) == families


def test_only_the_simulated_drive_comes_with_its_data_sheet() -> None:
    assert [name for name in drive_profiles.shipped() if drive_profiles.load(name).eds] == ["simulated"]
    assert Path(drive_profiles.load("simulated").eds).is_file()


def test_what_the_makers_say_is_in_their_profiles() -> None:
    epos, ipos, prbt = (drive_profiles.load(name) for name in ("maxon_epos4", "technosoft_ipos", "pilz_prbt"))
    assert (epos.mode, epos.quick_stop_code, epos.home_offset) == (CyclicMode.CSP, 6, 0x30B0)
    assert (ipos.mode, ipos.supervision) == (CyclicMode.IP, Supervision.GUARDING)
    assert [(one.index, one.sub, one.times) for one in epos.encoder_resolution] == [
        (0x3000, 5, 1),
        (0x3010, 1, 4),
    ]
    assert ipos.velocity_unit_counts_s * 65536 == 1000 and ipos.acceleration_unit_counts_s2 * 65536 == 1e6
    assert (prbt.quick_stop_code, prbt.abort_code, prbt.homing_methods) == (None, None, (0,))


def test_a_profile_beside_the_machine_file_is_named_by_its_path(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(LEAST + 'period_ms = [2, 8]\n[[write]]\nobject = "2210:01"\nvalue = -3\nwhy = "so"\n')
    found = drive_profiles.load(str(file))
    assert (found.name, found.period_min_s, found.period_max_s) == (str(file), 0.002, 0.008)
    assert found.writes == (Write(0x2210, 1, -3, "so"),)


def test_a_data_sheet_is_looked_for_beside_the_profile(tmp_path: Path) -> None:
    (tmp_path / "drive.eds").write_text("x")
    found = drive_profiles.read(LEAST + 'eds = "drive.eds"\n', "mine.toml", tmp_path, "mine")
    assert found.eds == str((tmp_path / "drive.eds").resolve())


def sentences(name: str) -> list[str]:
    """What a profile tells whoever commissions."""
    found = drive_profiles.load(name)
    whys = [one.why for one in found.writes]
    return [*found.quirks, *whys, *(one.reason for one in found.overrides)]


def test_what_shipped_profiles_say_are_texts_of_the_catalogue_and_none_is_of_one_that_is_gone() -> None:
    said_by = [one for name in drive_profiles.shipped() for one in sentences(name)]
    said_by += [inverter_profiles.load(name).watchdog for name in inverter_profiles.shipped()]
    assert all(isinstance(one, Key) for one in said_by), said_by
    assert set(said_by) == drive_profiles.TEXTS and len(said_by) > 10


def test_what_somebody_else_writes_in_his_profile_is_shown_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    write = '[[write]]\nobject = "2210:01"\nvalue = 1\nwhy = "file.add"\n'
    override = '[[override]]\nobject = "6085"\nhigh = 9\nreason = " profile.elmo.buffer_clear "\n'
    file.write_text(LEAST + 'quirks = ["no_why", { text = "profile.pilz_prbt.rpdos" }]\n' + write + override)
    words = [messages.text(messages.plain(one), "de") for one in sentences(str(file))]
    named = LANGUAGES["de"].texts["profile.pilz_prbt.rpdos"]
    assert words == ["no_why", named, "file.add", "profile.elmo.buffer_clear"]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", r"mine\.toml: top level: drive: is missing"),
        ("[drive]\n", r"mine\.toml:\d+: \[drive\]: supervision: is missing; allowed: \"heartbeat\" or"),
        (LEAST + "rpd = 2\n", r"rpd = 2: this key is not known; .* did you mean 'rpdo'"),
        (LEAST + '[[override]]\nobject = "1016:01"\nhigh = 3\n', r"\[\[override\]\] 1: reason: is missing"),
        (LEAST + "[more]\n", r"top level: more = .* this key is not known"),
        (LEAST + 'mode = "pp"\n', r'mode = "pp": is not known; allowed: "csp" or "ip"'),
        (LEAST + "rpdo = 5\n", "rpdo = 5: is out of range or not whole; allowed: a whole number from 1 to 4"),
        (LEAST + "rpdo = 2\n", "command_rpdo: RPDO 2 carries the target already"),
        (LEAST + 'mode = "ip"\n', "feed_forward: in interpolated position mode there is no 60B1h"),
        (LEAST + "period_ms = [4, 2]\n", r"period_ms = \[4, 2\]: is no range"),
        (LEAST + "period_ms = [0, 2]\n", "is no range"),
        (LEAST + "period_exponents = []\n", "period_exponents = .*: is not such a list"),
        (LEAST + "period_exponents = [3]\n", "a list of whole numbers from -6 to -1"),
        (LEAST + "quick_stop_code = 9\n", "quick_stop_code = 9: is out of range"),
        (LEAST + 'quick_stop_code = "off"\n', "quick_stop_code = .*: is out of range or not whole"),
        (LEAST + "homing_methods = [37.5]\n", "homing_methods = .*: is not such a list"),
        (LEAST + 'home_offset = "hello"\n', 'home_offset = "hello": is no object'),
        (LEAST + 'optional = ["60Z4"]\n', "optional = .*: is not a list of objects"),
        (LEAST + "quirks = [3]\n", "quirks = .*: is not a list of texts"),
        (
            LEAST + 'quirks = [{ text = "no_why" }]\n',
            "quirks = .*: is no text; allowed: a text in quotes, or",
        ),
        (LEAST + 'quirks = [{ text = ["profile."] }]\n', "quirks = .*: is no text"),
        (LEAST + "quirks = [{}]\n", "quirks = .*: is no text"),
        (LEAST + 'eds = "gone.eds"\n', "eds = .*there is no file .*gone.eds"),
        (LEAST + '[[write]]\nobject = "22:1"\nvalue = 1\nwhy = "x"\n', r'object = "22:1": is no object'),
        (LEAST + '[[write]]\nobject = "2210:01"\nvalue = 1.5\nwhy = "x"\n', "value = 1.5: is not a whole"),
        (LEAST + '[[write]]\nobject = "2210:01"\nvalue = 1\n', "why: is missing"),
        (LEAST + '[[write]]\nobject = "2210:01"\nvalue = 1\nwhy = { a = 1 }\n', "why = .*: is no text"),
        (LEAST + '[[write]]\nobject = "2210:01"\nvalue = 1\nwhy = 3\n', "why = 3: is not a text"),
        (LEAST + '[[write]]\nobject = "2210:01"\nvalue = 1\nwhy = "x"\nwhen = 1\n', "when = 1: this key"),
        (LEAST + "acceleration_unit_counts_s2 = 2.0\n", "velocity_unit_counts_s is missing"),
        (LEAST + "velocity_unit_counts_s = 0\n", "velocity_unit_counts_s = 0: is not above zero"),
        (LEAST + 'revolution = "load"\n', 'revolution = "load": is not known; allowed: "motor" or "shaft"'),
        (LEAST + '[[encoder_resolution]]\nobject = "30:05"\n', r'object = "30:05": is no object'),
        ("[drive\n", r"mine\.toml:1:7: \[drive: is not TOML: the brackets"),
    ],
)
def test_a_slip_is_one_sentence(text: str, sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        read(text)


def test_an_unknown_name_is_answered_with_the_near_one() -> None:
    with pytest.raises(ConfigError, match=r"maxon_epos5: there is no .*did you mean 'maxon_epos4'"):
        drive_profiles.load("maxon_epos5")


def test_a_profile_says_where_its_familys_sheets_are_wrong() -> None:
    gold = drive_profiles.load("elmo_gold")
    assert (gold.mode, gold.vendor) == (CyclicMode.CSP, drive_profiles.load("elmo").vendor)
    (wrong,) = gold.overrides
    assert (wrong.index, wrong.sub, wrong.high) == (0x1016, 1, 0xFFFF_FFFF)
    assert wrong.reason


# Objects and overrides in TOML tables; every slip is one sentence with file, table and key.

LEAST_OBJECTS = '[[override]]\nobject = "1016:01"\nreason = "so"\n'


def read_objects(text: str) -> tuple[Override, ...]:
    return drive_profiles.overrides(parse(text, "mine.toml"))


def test_every_word_of_a_data_sheet_may_be_overridden() -> None:
    text = 'low = -5\nhigh = 0xFFFFFFFF\naccess = "rw"\ndefault = 3\nmappable = true\ntype = "UNSIGNED32"\n'
    assert read_objects(LEAST_OBJECTS + text) == (
        Override(0x1016, 1, "so", -5, 0xFFFF_FFFF, "rw", 3, True, 0x07),
    )
    assert read_objects("") == ()
    (one,) = read_objects('[[override]]\nobject = "607A"\nmappable = false\nreason = "so"\n')
    assert (one.index, one.sub, one.mappable, one.high) == (0x607A, 0, False, None)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            LEAST_OBJECTS,
            r"mine\.toml:\d+: \[\[override\]\] 1: object = .*: nothing of it is overridden; allowed: one of",
        ),
        (LEAST_OBJECTS.replace("reason", "high = 3\n#"), "reason: is missing"),
        (LEAST_OBJECTS.replace('"so"', '" "') + "high = 3\n", "reason = .*: is empty"),
        (LEAST_OBJECTS.replace("1016:01", "16:01") + "high = 3\n", 'object = "16:01": is no object'),
        (LEAST_OBJECTS + 'high = "all"\n', "high = .*: is out of range or not whole"),
        (LEAST_OBJECTS + "high = 3.5\n", "high = 3.5: is out of range or not whole"),
        (LEAST_OBJECTS + "low = 5\nhigh = 3\n", "low = 5: is above high = 3"),
        (LEAST_OBJECTS + 'access = "r"\n', 'access = "r": is not known; allowed: "ro" or "wo"'),
        (LEAST_OBJECTS + "mappable = 1\n", "mappable = 1: is not true or false"),
        (LEAST_OBJECTS + 'type = "u32"\n', 'type = "u32": is not known; allowed: "INTEGER8" or'),
        (LEAST_OBJECTS + "hihg = 3\nlow = 1\n", "hihg = 3: this key is not known; .* did you mean 'high'"),
        ("override = 3\n", "override = 3: is not an array of tables"),
    ],
)
def test_a_slip_in_an_object_is_one_sentence(text: str, sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        read_objects(text)


def text_of(more: str) -> str:
    """The trunnion's machine file with lines added to axis X."""
    return machine_file.load("trunnion").text.replace('name = "X"\n', f'name = "X"\n{more}\n', 1)


def test_an_axis_overrides_its_drives_sheet_and_tells_so_to_the_bus_side() -> None:
    line = 'override = [{ object = "605A:00", high = 7, reason = "firmware 3" }]'
    machine = machine_file.read(text_of(line), "mine.toml", machine_file.SHIPPED)
    x, y = nodes.node_settings(machine)[:2]
    assert x.overrides == (Override(0x605A, 0, "firmware 3", high=7),)
    assert y.overrides == ()


def test_a_slip_in_an_axis_names_the_axis() -> None:
    with pytest.raises(ConfigError, match=r"\[\[axis\]\] X: \[\[override\]\] 1: reason: is missing"):
        machine_file.read(
            text_of('override = [{ object = "605A", high = 7 }]'), "mine.toml", machine_file.SHIPPED
        )


def test_spindle_and_io_node_may_be_unsupervised_and_overridden_too() -> None:
    more = """
[spindle]
max_rev_min = 12000
node = 10
counts_per_rev = 4096
unsupervised = true
override = [{ object = "6085", high = 9, reason = "so" }]
[io]
node = 11
inputs = { door = 1 }
unsupervised = true
override = [{ object = "6005", access = "rw", reason = "so" }]
"""
    text = without_spindle(machine_file.load("trunnion").text) + more
    machine = machine_file.read(text, "m.toml", machine_file.SHIPPED)
    *_, spindle, io = nodes.all_settings(machine)
    assert spindle.unsupervised and io.unsupervised
    assert (spindle.overrides[0].index, io.overrides[0].access) == (0x6085, "rw")
