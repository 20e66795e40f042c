"""Every command that the pages beside the code name is run: as it is written, with files for its capitals."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest
from support.live.ports import free_port
from support.live.shop import HANGS_S
from test_pages import COMMANDS, ROOT

EXAMPLE, SECOND = "config/programs/example1_ready.ngc", "config/programs/example2_ready.ngc"
RUN = f"{ROOT}/tests/data/runs/hold_and_resume_on_ruled_surfaces"
LASER = "for x in 0 50 100 150; do echo $x,1,$x.00$n; echo $x,-1,$x.01$n; done >> m.csv"
BLOCK = """cat > part.toml <<'END'
name = "block"
frame = "G54"
[[solid]]
kind = "block"
low_mm = [0.0, 0.0, -30.0]
high_mm = [80.0, 50.0, 0.0]
END
printf 'T99 M6\\nG43 H99\\nG0 X40 Y25 Z20\\nG38.2 Z-5 F100\\nG0 Z20\\nM30\\n' > probe.ngc"""
TWO_TOOLS = (
    "printf 'T2 M6\\nG43 H2\\nM3 S3000\\nG0 X20 Y20 Z40\\nT3 M6\\nG43 H3\\nG0 X0 Y0\\nM30\\n' > two_tools.ngc"
)
DIRECTRIX = f'directrix() {{ {sys.executable} -m controller "$@"; }}\n'

ANSWERED = ("yes '' | head -50 > answers", "machine new mine.toml --ask < answers")

# Of the tutorial all lines are run, one after another.
TUTORIAL = "config/TUTORIAL.md"

# On a desk: what comes before it, and what is run. Left out: nothing, and the command as it stands.
DESK: dict[str, tuple[str, str]] = {
    "bench [NAME]": ("", "bench reader --short"),
    "bench [NAME] [--short] [--json] [--plot DIR]": ("", "bench reader --short --json --plot ."),
    "bench --readme README.md": (
        "echo '<!-- figures --><!-- end of figures -->' > README.md",
        "bench start --short --readme README.md",
    ),
    "bench check": ("", "bench check --short"),
    "bring-up FOLDER --machine FILE --simulate": (
        "",
        "bring-up folder --machine config/shop.toml --simulate --step scale.X --yes all --value scale.X=10",
    ),
    "bus FILE": ("", "bus config/trunnion.toml"),
    "bus MACHINE": ("", "bus config/trunnion.toml"),
    "bus MACHINE --plot bus.png": ("", "bus config/trunnion.toml --plot bus.png"),
    "calibrate axis FILE.csv --axis X": (
        f"echo target,sense,measured > m.csv; for n in 1 2 3; do {LASER}; done",
        "calibrate axis m.csv --axis X",
    ),
    "check --machine FILE": ("", f"check {EXAMPLE} --machine config/trunnion.toml"),
    "check DIR --report out.html": (
        "mkdir d; cp config/programs/example1_ready.ngc d",
        "check d --report out.html",
    ),
    "check PROGRAM": ("", f"check {EXAMPLE}"),
    "compare A B": ("", f"compare {RUN} {RUN}"),
    "compare A B [--tolerance T]": ("", f"compare {RUN} {RUN} --tolerance 0.001"),
    "demo": ("", ""),
    "demo --part ruled": ("", ""),
    "drives check --eds FILE --profile NAME": (
        "",
        "drives check --eds config/eds/simulated_drive.eds --profile simulated",
    ),
    "drives profile SHEET.eds --output mine.toml": (
        "",
        "drives profile config/eds/simulated_drive.eds --output mine.toml",
    ),
    "machine new FILE.toml --ask": ANSWERED,
    "machine new mine.toml --ask": ANSWERED,
    "drives simulate --profile maxon_epos4 --nodes 1-5": (
        "",
        "timeout -s INT 20 {python} -m controller "
        "drives simulate --profile maxon_epos4 --nodes 1-5 --channel can",
    ),
    "explain PROGRAM": ("", f"explain {EXAMPLE}"),
    "export RECORDING OUT.parquet": ("", f"export {RUN} out.parquet"),
    "faults MACHINE": ("", "faults config/trunnion.toml"),
    "faults MACHINE --language de": ("", "faults config/trunnion.toml --language de"),
    "fit PROGRAM --tolerance 0.01": ("", f"fit {EXAMPLE} --tolerance 0.01"),
    "fit PROGRAM --tolerance 0.02": ("", f"fit {SECOND} --tolerance 0.02"),
    "paper": ("", ""),
    "post PROGRAM --chord 0.01": ("", f"post {EXAMPLE} --chord 0.01"),
    "replay RUN": ("", f"replay {RUN}"),
    "simulate PROGRAM --events FILE": (
        """echo '{"tick": 500, "request": "hold"}' > e; echo '{"tick": 900, "request": "resume"}' >> e""",
        f"simulate {EXAMPLE} --events e",
    ),
    "simulate PROGRAM --part PART.toml --touches FILE.csv": (
        BLOCK,
        "simulate probe.ngc --machine machining_centre --part part.toml --touches touches.csv",
    ),
    "simulate PROGRAM --trace t.npz --plot t.png --faults FILE": (
        "echo 'at 2.5 s: drop rpdo 3 x 1' > f",
        f"simulate {EXAMPLE} --trace t.npz --plot t.png --faults f",
    ),
    "simulate two_tools.ngc --machine machining_centre": (TWO_TOOLS, ""),
    "soak --hours 8": ("", "soak --hours 0.002"),
    "verify FOLDER --program PROGRAM": (
        f"echo 'at 4 s: sto 3' > f; directrix simulate {EXAMPLE} --faults f || true",
        f"verify state/directrix/recordings/* --program {EXAMPLE}",
    ),
    "verify PROGRAM": ("", f"verify {EXAMPLE}"),
    "verify PROGRAM --plot cut.png": ("", f"verify {EXAMPLE} --plot cut.png"),
    "verify t.npz --program PROGRAM": (
        f"directrix simulate {EXAMPLE} --trace t.npz",
        f"verify t.npz --program {EXAMPLE}",
    ),
}

# In a shop, one after another as in an operator's day: the page's command, what is run, the mode behind it.
MACHINE = "/etc/directrix/machine.toml"
SHOP: tuple[tuple[str, str, str], ...] = (
    ("status", "", "OFF"),
    ("changer confirm --spindle 2 --clear", "", "OFF"),
    ("home", "", ""),
    ("enable", "", "READY"),
    ("upload bracket.ngc", "", "READY"),
    ("start bracket.ngc", "", "RUNNING"),
    ("hold", "", "HOLD"),
    ("status --watch", "timeout -s INT 5 {python} -m controller status --watch", "HOLD"),
    ("", "stop", "READY"),
    ("start --restart", "start --restart <<< y", "RUNNING"),
    ("", "stop", "READY"),
    ("start --unrecorded", "start bracket.ngc --unrecorded", "RUNNING"),
    ("", "stop", "READY"),
    ("offsets", "", "READY"),
    ("", "mdi 'G10 L2 P1 X5'", "READY"),
    ("offsets --forget G54", "", "READY"),
    ("tools --export tool.tbl", "", "READY"),
    ("tools --set 2 wear_length_mm=-0.02", "", "READY"),
    ("tools --life 2 --minutes 60 --sister 3", "", "READY"),
    ("tokens add NAME --days 90", "tokens add cam --days 90", "READY"),
    ("probe", "", "READY"),
    ("probe --found", "", "READY"),
    ("runs", "", "READY"),
    ("backup save monday.zip", "", "READY"),
    ("backup check monday.zip", "", "READY"),
    ("estop", "", "FAULT"),
)
BEGINS = ("serve --simulate --machine machining_centre", "panel")  # before them
BEHIND = (  # when the service has ended
    (f"backup update new.toml --machine {MACHINE}", "backup update config/new.toml --machine {machine}"),
    (f"backup restore monday.zip --machine {MACHINE}", "backup restore monday.zip --machine {machine}"),
    ("backup rollback", "backup rollback --machine {machine}"),
    ("users add anna --state /var/lib/directrix", "users add anna --state other < password"),
)
BRACKET = "T2 M6\nG43 H2\nS1000 M3\nG0 X0 Y0 Z50\nG1 X20 F3\nX0\nM30\n"

# What needs another machine, another kernel or CAD is run by the tests that have it, in these words.
ELSEWHERE: dict[str, tuple[str, str]] = {
    "adaptive on": ("controller/cli/test_client.py", '("adaptive", "on")'),
    "calibrate rotaries TOUCHES.csv --sphere-radius R": ("controller/cli/test_calibrate.py", '"rotaries"'),
    "calibrate spindle READINGS.csv --machine FILE": (
        "controller/calibration/test_spindle_speed.py",
        '"calibrate", "spindle"',
    ),
    "check DIR --cluster tcp://HOST:8786": ("controller/cli/test_check_folder.py", '"--cluster"'),
    "demo --panel": ("acceptance/test_a_busy_computer.py", '"demo"'),
    "dnc receive --port /dev/ttyUSB0 --baud 9600 --format 7E2 --flow xon": (
        "controller/cli/test_dnc.py",
        '"receive"',
    ),
    "dnc send O4711 --port /dev/ttyUSB0": ("controller/api/test_dnc.py", '"send"'),
    "drives commission --set-node X": ("controller/cli/test_drives.py", '"--set-node"'),
    "drives save X FILE.dcf": ("controller/cli/test_kept_drives.py", '"save"'),
    "drives save X x.dcf --machine FILE": ("controller/cli/test_kept_drives.py", '"save"'),
    **{
        f"host measure {words}": ("controller/cli/test_host_measure.py", '"--period-ms", "1"')
        for words in (
            "--hours 8 --period-ms 1",
            "--hours 1 --period-ms 1 --report before.html",
            "--hours 8 --period-ms 1 --report after.html",
        )
    },
    "import wall.cls --list": ("controller/cli/test_cad_path.py", '"--list"'),
    "import wall.cls --faces all --tolerance 0.005": ("controller/cli/test_cad_path.py", '"--faces"'),
    "import part.step --list --plot part.svg": ("controller/cli/test_cad.py", '"--plot"'),
    "import wheel.step --faces blades --turn X90 --verify": ("controller/cli/test_cad.py", '"--verify"'),
    "import part.step --faces 3,7,4 --turn X90 --move 0,0,12 --feed 400 --out part.ngc": (
        "controller/cli/test_cad.py",
        '"--turn"',
    ),
    "probe edge towards=X- most=20 --offset G54": ("controller/cli/test_client.py", '"probe"'),
    "probe --touches touches.csv": ("controller/cli/test_client.py", '"--touches"'),
    "runs --keep 12": ("controller/cli/test_client.py", '"--keep"'),
    "serve --pendant pendant.toml": ("controller/service/test_pendant.py", "pendant.toml"),
    "service install --machine /etc/directrix/machine.toml": ("guest/systemd/conftest.py", '"install"'),
    "service self-test": ("guest/systemd/test_services.py", '"self-test"'),
    "service status": ("guest/systemd/test_services.py", '"service", "status"'),
    "service sbom sbom.json": ("controller/cli/test_update.py", '"sbom"'),
    "service update directrix-0.2.0-py3-none-any.whl": ("controller/cli/test_update.py", '"update"'),
    "service rollback": ("controller/cli/test_update.py", '"rollback"'),
    "service uninstall": ("guest/systemd/conftest.py", '"uninstall"'),
    "serve --simulate": ("support/live/shop.py", '"--simulate"'),
    "state check": ("controller/cli/test_state.py", '"state", "check"'),
    "state requests": ("controller/cli/test_state.py", '"state", "requests"'),
    "support case.zip": ("controller/cli/test_support.py", '"support"'),
    "withdraw": ("controller/service/test_command_handlers.py", '"withdraw"'),
}


def bare(line: str) -> str:
    """Without its remark and its name."""
    return " ".join(line.split("#")[0].split()).removeprefix("directrix ")


def named_only(words: str) -> bool:
    """A command's name in a sentence, such as ``directrix drives``: not something to type."""
    return all(word.isalpha() for word in words.split())


def test_every_command_is_run_somewhere() -> None:
    in_the_shop = {words for words, *_ in (*SHOP, *BEHIND) if words}
    here = {*DESK, *in_the_shop, *BEGINS, *ELSEWHERE}
    wanted = {bare(line) for room, line in COMMANDS if room != "first chip"}
    assert sorted(words for words in wanted - here if not named_only(words)) == []
    assert sorted(here - wanted) == [], "no page says it any more"


@pytest.mark.parametrize("words", ELSEWHERE)
def test_what_is_run_elsewhere_is_there(words: str) -> None:
    file, said = ELSEWHERE[words]
    assert said in (ROOT / "tests" / file).read_text(encoding="utf-8")


def shell(text: str, folder: Path, **more: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "XDG_STATE_HOME": str(folder / "state"), **more}
    text = DIRECTRIX + text.replace("{python}", sys.executable)
    return subprocess.run(
        ["bash", "-ec", text], cwd=folder, env=environment, capture_output=True, text=True, timeout=600
    )


def ran(words: str, before: str, folder: Path, **more: str) -> str:
    """What it says; exit code 0, or that of a command which goes on until Ctrl-C."""
    text = words if words.startswith(("timeout", "directrix")) else f"directrix {words}"
    done = shell(f"{before}\n{text}\n", folder, **more)
    wanted = (0, 124, 130) if words.startswith("timeout") else (0,)
    assert done.returncode in wanted and "Traceback" not in done.stderr, (text, done.stdout, done.stderr)
    assert done.stdout.strip() or done.stderr.strip(), text
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("words", DESK)
def test_a_command_of_a_desk_does_what_it_says(words: str, tmp_path: Path) -> None:
    before, instead = DESK[words]
    shutil.copytree(ROOT / "config", tmp_path / "config")
    ran(instead or words, before, tmp_path)
    for file in re.findall(r"--(?:plot|trace|report) (\S+\.\S+)", instead or words):
        assert (tmp_path / file).stat().st_size > 1000


@pytest.mark.slow
def test_the_tutorial_leads_from_five_drives_to_the_first_chip(tmp_path: Path) -> None:
    """Every block, as it is written; each line succeeds, and what the page says of the figures is so."""
    blocks = re.findall(r"```sh\n(.*?)```", (ROOT / TUTORIAL).read_text(encoding="utf-8"), re.DOTALL)
    shutil.copy(ROOT / SECOND, tmp_path)
    said = [ran(f"directrix --version\n{block}", "", tmp_path) for block in blocks]
    assert len(said) == 8
    first, again = said[4], said[5]
    assert "feed_forward = true" in first and "3.751 ms" in first
    assert "feed_forward = true" not in again.split("[[axis]] C")[0]
    report = (tmp_path / "protocol" / "bring_up.html").read_text(encoding="utf-8")
    assert report.count("<svg") > 10 and "of another machine file" in report


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.calm
def test_the_commands_of_a_shop_do_what_they_say_one_after_another(tmp_path: Path) -> None:
    port = free_port()
    more = {"XDG_RUNTIME_DIR": str(tmp_path), "DIRECTRIX_URL": f"http://127.0.0.1:{port}"}
    (tmp_path / "bracket.ngc").write_text(BRACKET)
    (tmp_path / "password").write_text("long enough a word\n")
    shutil.copytree(ROOT / "config", tmp_path / "config")
    shutil.copy(tmp_path / "config" / "machining_centre.toml", tmp_path / "config" / "new.toml")
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "XDG_STATE_HOME": str(tmp_path / "state"), **more}
    begun = []
    try:
        for words in (BEGINS[0], f"{BEGINS[1]} --port {port}"):
            line = [sys.executable, "-m", "controller", *words.split()]
            with open(tmp_path / "log", "ab") as log:
                begun.append(subprocess.Popen(line, cwd=tmp_path, env=environment, stdout=log, stderr=log))
        awaited(more["DIRECTRIX_URL"], tmp_path / "log")
        for words, instead, mode in SHOP:
            ran(instead or words, "", tmp_path, **more)
            awaited(more["DIRECTRIX_URL"], tmp_path / "log", mode)
    finally:
        for process in reversed(begun):
            process.terminate()
            process.wait(60.0)
    for _, words in BEHIND:
        ran(words.format(machine="config/machining_centre.toml"), "", tmp_path, **more)


def awaited(url: str, log: Path, mode: str = "") -> None:
    """Until nothing is under way, in this mode; ``HANGS_S`` only ends what hangs."""
    give_up_s, now = time.monotonic() + HANGS_S, {}
    while time.monotonic() < give_up_s:
        with contextlib.suppress(httpx.TransportError, httpx.HTTPStatusError):
            now = httpx.get(f"{url}/api/v1/status").raise_for_status().json()
            busy = (now["sequence"] or {}).get("state") == "running"
            if not busy and mode in ("", now["mode"]):
                # What is stopped before its first cut is not gone on with: an operator is not that quick.
                time.sleep(1.5 if mode == "RUNNING" else 0.0)
                return
        time.sleep(0.2)
    raise AssertionError((mode, now, log.read_text()))
