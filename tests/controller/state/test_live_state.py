"""The live state: declared once, and told everywhere as it is declared."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from enum import Enum
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from support.machines.stepped_runs import shipped
from support.machines.tick_bench import Bench

from controller.api import metrics, models, signals
from controller.api.models_of_tick import DriveFacts, OfTick
from controller.ipc.handoff import COLUMN, ROW, Recorder, SnapshotBoard
from controller.messages import LANGUAGES
from controller.runtime.plan_messages import POWER_ON
from controller.service import node_status, status
from controller.state import live_state
from controller.state.live_state import DRIVES, FIELDS, OWNERS, Field, Snapshot
from controller.state.modes import MAX_AXES

ROOT = Path(__file__).resolve().parents[3]

# Where the attribute at the owner has another name than the value.
OTHERWISE = {
    "plan_time_s": "follow.tau",
    "feed_mm_s": "follow.feed",
    "spindle_rev_min": "peripherals.rev_min",
    "spindle_actual_rev_min": "peripherals.actual_rev_min",
    "spindle_at_speed": "peripherals.at_speed",
    "thread_mm": "coupling.led_mm",
    "spindle_turns": "coupling.turns",
    "spindle_load": "coupling.load",
    "thread_rev": "coupling.depth_rev",
    "adaptive_share": "adaptive.share",
    "adaptive_on": "adaptive.on",
    "thread_pitch_mm": "coupling.pitch_mm",
    "jogging": "jogging.active",
    "probing": "probing.phase",
    "probings": "probing.count",
    "probed": "probing.came",
    "answers": "answers.ring",
    "drive_states": "drives.state",
    "chatter_id": "chatter.can_id",
    "chatter_per_s": "chatter.per_s",
}
# Columns of recordings as they have been since 2026-11; of old ones none may change its place.
COLUMNS = [
    *("tick", "mode", "fault", "motion_id", "line", "cutting", "plan_time_s", "s", "rate", "feed_mm_s"),
    *(f"{name}_{i}" for name in ("joint_command", "setpoint", "actual") for i in range(5)),
    *("lateness_s", "sync_sent", "accepted", "limited_by", "override", "rapid_override"),
    *("switches", "request", "bus_share"),
]


FLAGS = [field.name for field in FIELDS if field.type is bool]
assert len(FLAGS) <= 1 << 5, "five turns tell no more apart"


def unlike(n: int, field: Field, turn: int, axes: int = MAX_AXES) -> Any:
    """A value of its type that no other one has; of flags, no two are alike in all of five turns."""
    if field.type is bool:
        return bool(FLAGS.index(field.name) >> turn & 1)
    if issubclass(field.type, Enum):
        return list(field.type)[n % len(field.type)]
    one = 1000 * (n + 1) + (0.5 if field.type is float else 0)
    return one if field.many == 1 else tuple(one + i for i in range(axes if field.is_of_axes else field.many))


@pytest.mark.parametrize("axes", [3, 4, MAX_AXES])
@pytest.mark.parametrize("turn", range(5))
def test_every_value_goes_from_its_owner_through_memory_to_its_own_name(turn: int, axes: int) -> None:
    values = {field.name: unlike(n, field, turn, axes) for n, field in enumerate(FIELDS)}
    parts: dict[str, Any] = {name: SimpleNamespace() for name in OWNERS}
    parts[DRIVES] = [SimpleNamespace() for _ in range(axes)]
    for field in FIELDS:
        part, _, attribute = OTHERWISE.get(field.name, f"{field.part}.{field.name}").partition(".")
        each = part == DRIVES
        owners = parts[part] if each else [parts[part]]
        for owner, value in zip(owners, values[field.name] if each else [values[field.name]], strict=True):
            setattr(owner, attribute, value)
    board, recorder = SnapshotBoard(axes=axes), Recorder(rows=4)
    flat = live_state.gather(axes)(*(parts[name] for name in OWNERS))
    board.write(flat)
    recorder.write(flat[: len(ROW)])
    found = board.read()
    assert found is not None and found._asdict() == values
    assert live_state.flat(found) == flat
    row = recorder.last(1)[0]
    for field in FIELDS:
        if field.value.column:
            wanted = values[field.name] if field.many > 1 else [values[field.name]]
            left = [0.0] * (MAX_AXES - axes) * field.is_of_axes
            assert [row[COLUMN[column]] for column in field.columns] == [*wanted, *left], field.name


def test_a_value_is_written_by_the_attribute_of_its_name_or_one_that_is_known() -> None:
    others = {f.name: f"{f.part}.{f.attribute}" for f in FIELDS if f.attribute != f.name}
    assert others == OTHERWISE
    assert len({(f.part, f.attribute) for f in FIELDS}) == len(FIELDS)


def test_columns_come_first_and_in_the_order_of_all_recordings() -> None:
    assert list(ROW[: len(COLUMNS)]) == COLUMNS
    has = [bool(field.value.column) for field in FIELDS]
    assert has == sorted(has, reverse=True) and len(set(ROW)) == len(ROW)
    assert all(field.value.column for field in FIELDS if field.signal is not None)


def test_what_a_tick_leaves_is_of_the_type_that_is_declared() -> None:
    bench = Bench()
    bench.enable()
    parts = dict(zip(OWNERS, bench.cycle._status._owners, strict=True))
    for field in FIELDS:
        if field.part == DRIVES:
            value = [getattr(drive, field.attribute) for drive in parts[DRIVES]]
        else:
            value = getattr(parts[field.part], field.attribute)
        for one in value if field.many > 1 else (value,):
            assert isinstance(one, field.type) or (field.type is float and type(one) is int), field.name
    bench.close()


def test_row_and_snapshot_of_a_tick_are_the_same_values() -> None:
    bench = Bench()
    bench.enable()
    row, now = bench.recorder.last(1)[0], bench.snapshot
    assert list(row) == [float(one) for one in live_state.flat(now)[: len(ROW)]]
    bench.close()


# --- the status, OpenAPI, the scope


def test_the_status_tells_what_is_declared_in_shown_units() -> None:
    now = live_state.blank()._replace(late_max_s=0.00025, feed_mm_s=10.0, tick=7, spindle_rev_min=-1200.0)
    told = live_state.status_values(now)
    assert told["tick"] == {
        "number": 7,
        "skips": 0,
        "late_max_ms": 0.25,
        **dict.fromkeys(("played", "braked", "latency", "lost_frames"), 0),
    }
    assert told["feed_mm_min"] == {"actual": 600.0} and told["spindle"]["rev_min"] == -1200.0
    assert told["mode"] == "OFF" and told["warning"] is None and told["at_rest"] is False


def keys(told: dict[str, Any]) -> set[str]:
    """Of an object and of those in it, with a dot."""
    inside = {f"{key}.{k}" for key, value in told.items() if isinstance(value, dict) for k in value}
    return {key for key, value in told.items() if not isinstance(value, dict)} | inside


def described(schema: dict[str, Any], name: str = "") -> set[str]:
    """The fields of a model as OpenAPI has it, with a dot those of the models in it."""
    found = set()
    for key, one in (schema["$defs"][name] if name else schema)["properties"].items():
        inner = [o["$ref"].rpartition("/")[2] for o in one.get("anyOf", ()) if "$ref" in o]
        found |= {f"{key}.{k}" for k in schema["$defs"][inner[0]]["properties"]} if inner else {key}
    return found


def test_openapi_describes_what_the_tick_and_the_drives_tell() -> None:
    class Both(models.Told):
        tick: OfTick
        drive: DriveFacts

    schema = Both.model_json_schema()
    besides = {"tick.period_ms", "tick.age_s", "feed_mm_min.programmed"}
    assert described(schema, "OfTick") == keys(live_state.status_values(live_state.blank())) | besides
    machine = shipped()
    row = node_status.drives(machine, live_state.blank(), {})[0]
    said = {"error.key", "error.values", "error.sentence"}
    assert described(schema, "DriveFacts") == {*row, "temperature_c", "load_off"} - {"error"} | said
    properties = schema["$defs"]["DriveFacts"]["properties"]
    assert all(one["description"] for one in properties.values())


def test_everything_that_the_status_makes_of_a_snapshot_is_described() -> None:
    told = status.machine_values(shipped(), live_state.blank(), None, POWER_ON)
    assert set(told) <= set(models.Status.model_fields)
    checked = models.Status.model_validate({**told, "drives": []})
    assert checked.model_dump()["tick"]["period_ms"] == told["tick"]["period_ms"]


def test_every_signal_of_the_scope_is_a_declared_column_in_its_shown_unit() -> None:
    machine = shipped()
    units = signals.names(machine)
    for field in FIELDS:
        if field.signal is not None:
            assert units[field.signal.name] == field.signal.unit
            assert live_state.SIGNALS[field.signal.name][1] == field.value.column


def test_scripts_of_the_page_take_nothing_of_a_status_that_is_not_described() -> None:
    """By name, and with a dot in what the tick tells as an object; "shown" is what the page makes itself."""
    fields = described(models.Status.model_json_schema())
    known = {key.partition(".")[0] for key in fields if "." in key}
    read, missing = 0, []
    for script in (ROOT / "controller").rglob("*.js"):
        taken = re.findall(r"\bstatus\??\.(\w+)(?:\??\.(\w+))?", script.read_text(encoding="utf-8"))
        for key, inner in taken:
            read += 1
            whole = f"{key}.{inner}" if inner and key in known else key
            if whole not in fields | known | {"shown"}:
                missing.append(f"{script.name}: status.{whole}")
    assert read > 10 and not missing


def test_metrics_take_nothing_of_a_status_that_is_not_described() -> None:
    fields = described(models.Status.model_json_schema())
    assert {".".join(path) for _, path, *_ in (*metrics.GAUGES, *metrics.COUNTERS)} <= fields


# --- the page for people


def test_what_a_column_means_is_a_text_of_the_catalogue() -> None:
    texts = LANGUAGES["en"].texts
    for value in (field.value for field in FIELDS if field.value.column):
        assert texts[f"column.{value.column}"] == value.meaning.replace("``", ""), value.column


def test_the_readme_has_the_table() -> None:
    text = (ROOT / "controller" / "README.md").read_text(encoding="utf-8")
    begin, end = (text.index(mark) for mark in ("<!-- live state -->\n", "<!-- end of live state -->"))
    assert text[begin:end].split("\n", 1)[1] == live_state.markdown()


# --- a new value


OWNER = (
    "controller/tick/mode.py",
    "        self.homed = self.absolute = absolute\n",
    "        self.counted = 41\n",
)
ROW_OF_IT = """
    counted: int = _value("modes", "since the start", column="counted", status="counted", signal="counted 1")
"""
SCHEMA = ("controller/state/live_state.py", "    # From here on no recording has them.\n", ROW_OF_IT)
ASK = """
import json
from support.machines.tick_bench import Bench
from support.machines.stepped_runs import shipped
from controller.state import live_state
from controller.api import models, signals
from controller.service import status
from controller.runtime.plan_messages import POWER_ON
from controller.runtime.plan_messages import POWER_ON
bench = Bench()
bench.enable()
row = bench.recorder.last(1)
told = status.machine_values(shipped(), bench.snapshot, None, POWER_ON)
print(json.dumps([
    live_state.__file__,
    bench.snapshot.counted,
    told["counted"],
    models.Status.model_json_schema()["properties"]["counted"]["description"],
    live_state.ROW[-1],
    float(row[0, -1]),
    float(signals.Signals(row, shipped()).values("counted")[0]),
    "counted" in live_state.markdown(),
]))
"""


def test_a_new_value_of_the_tick_needs_its_owner_and_its_row_alone(tmp_path: Path) -> None:
    """Two files; with the page, which shows what the status tells, and the table of the README: four. And
    the words for its column.
    """
    for part in ("controller", "drives", "config"):
        shutil.copytree(ROOT / part, tmp_path / part, ignore=shutil.ignore_patterns("__pycache__"))
    for path, before, new in (OWNER, SCHEMA):
        text = (tmp_path / path).read_text(encoding="utf-8")
        assert text.count(before) == 1, path
        (tmp_path / path).write_text(text.replace(before, new + before), encoding="utf-8")
    where = {**os.environ, "PYTHONPATH": os.pathsep.join((str(tmp_path), str(ROOT / "tests")))}
    asked = [sys.executable, "-c", ASK]
    done = subprocess.run(asked, cwd=tmp_path, env=where, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    file, *found = json.loads(done.stdout)
    assert file == str(tmp_path / "controller" / "state" / "live_state.py")
    assert found == [41, 41, "Since the start.", "counted", 41.0, 41.0, True]


def test_what_is_declared_of_a_value_is_no_default_of_it() -> None:
    with pytest.raises(TypeError, match="missing"):
        Snapshot()  # type: ignore[call-arg]
