"""How the script ``directrix`` leaves: at once, and nothing that was said or promised is lost."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

LEAVE = "from controller.__main__ import leave\n"


def left(text: str, **how: object) -> subprocess.CompletedProcess[str]:
    asked = {"capture_output": True, "text": True, "timeout": 60.0, **how}
    return subprocess.run([sys.executable, "-c", LEAVE + text], check=False, **asked)  # type: ignore[call-overload, no-any-return]


@pytest.mark.parametrize(("code", "found"), [("None", 0), ("0", 0), ("1", 1), ("70", 70)])
def test_the_code_and_all_that_was_said_get_out(code: str, found: int) -> None:
    done = left(f"import sys\nprint('x' * 100000)\nprint('y', end='', file=sys.stderr)\nleave({code})")
    assert (done.returncode, len(done.stdout), done.stderr) == (found, 100001, "y")


def test_what_is_to_be_done_at_the_end_is_done() -> None:
    assert left("import atexit\natexit.register(print, 'done')\nleave(0)").stdout == "done\n"


def test_a_thread_at_work_is_waited_for() -> None:
    late = "import threading\nthreading.Timer(0.2, print, ['late']).start()\n"
    assert left(late + "leave(0)").stdout == "late\n"


def test_a_sentence_as_code_is_told_as_python_does() -> None:
    done = left("leave('a sentence')")
    assert (done.returncode, done.stderr) == (1, "a sentence\n")


def test_a_listener_that_has_gone_is_told_by_the_code() -> None:
    """As ``directrix ... | head``: Python's own end, and its code for it."""
    with subprocess.Popen(
        [sys.executable, "-c", LEAVE + "import sys\nsys.stdin.read()\nprint('x' * 10)\nleave(0)"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"},
    ) as process:
        assert process.stdout is not None and process.stdin is not None
        process.stdout.close()
        process.stdin.close()
        assert process.wait(60.0) == 120


def test_the_command_leaves_so() -> None:
    told = (
        "import sys\nfrom controller.__main__ import script\nsys.argv = ['directrix', '--version']\nscript()"
    )
    done = left(told)
    assert done.returncode == 0 and done.stdout.startswith("directrix ")
