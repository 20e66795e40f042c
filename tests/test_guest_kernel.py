"""Whether a guest's kernel boots here, and what is done where not: find_kernel.sh before fake kernels."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

GUEST = Path(__file__).parent / "guest"
LIVES = 'echo "guest: its first process runs"'
# What User Mode Linux 6.1 says on a processor with AMX.
TOO_WIDE = 'echo "userspace - ptrace set fp regs failed, errno = 14"; exit 134'
HELPED = f'case "$LD_PRELOAD" in *wide_fp_state.so*) {LIVES} ;; *) {TOO_WIDE} ;; esac'
OTHERWISE = """
echo "mmapper_init - find_iomem failed" # as at every boot
echo "Checking that ptrace can change system call numbers...ptrace: Operation not permitted"
echo "and an end"
exit 1
"""
ASKED = """
set -euo pipefail
install() { echo "asked for $*"; return 1; }
refuse() { echo "refused: $1"; exit 125; }
. "$here/find_kernel.sh"
find_kernel && echo "found: $preload" || echo "none: $reason"
"""

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")


@dataclass
class Tried:
    """What was found out, and the modes that kernels were booted in."""

    said: str
    boots: list[str]


def tried(folder: Path, kernel: str, **variables: str) -> Tried:
    """The search for a kernel where ``linux.uml`` is this script."""
    log = folder / "boots"
    fake = folder / "linux.uml"
    fake.write_text(
        f"#!/bin/bash\nfor word; do case $word in guest_mode=*) echo ${{word#*=}} >>{log};; esac; done\n"
        f"{kernel}\n"
    )
    fake.chmod(0o755)
    own = {"here": str(GUEST), "job": str(folder), "room": str(folder), "memory": "64M"}
    path = f"{folder}:{os.environ['PATH']}"
    left_out = {"CC", "GUEST_WIDE_FP", "GUEST_LIKE_AMX"}
    environment = {key: value for key, value in os.environ.items() if key not in left_out}
    done = subprocess.run(
        ["bash", "-c", ASKED],
        env={**environment, **own, "PATH": path, **variables},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    return Tried(done.stdout, log.read_text().split() if log.exists() else [])


def test_a_kernel_that_boots_is_taken_as_it_is(tmp_path: Path) -> None:
    found = tried(tmp_path, LIVES)
    assert found.said == "found: \n"
    assert found.boots == ["probe"]


@needs_compiler
def test_a_state_that_is_too_large_is_named_and_helped(tmp_path: Path) -> None:
    found = tried(tmp_path, HELPED)
    assert (
        "larger than User Mode Linux's buffer (put_fp_registers); trying it with wide_fp_state.c"
        in found.said
    )
    assert found.said.endswith(f"found: {tmp_path}/wide_fp_state.so\n")
    assert found.boots == ["probe", "probe"]


def test_without_a_compiler_it_is_asked_for_and_told(tmp_path: Path) -> None:
    found = tried(tmp_path, HELPED, CC="no-such-compiler")
    assert "asked for gcc libc6-dev\n" in found.said
    assert "none: this processor's floating-point state" in found.said
    assert "no-such-compiler: command not found" in found.said


@needs_compiler
def test_help_that_does_not_help_is_told(tmp_path: Path) -> None:
    found = tried(tmp_path, TOO_WIDE)
    assert "none: this processor's floating-point state" in found.said
    assert found.said.endswith("also with wide_fp_state.c\n")


def test_another_reason_is_told_in_the_kernels_own_words_and_not_helped(tmp_path: Path) -> None:
    found = tried(tmp_path, OTHERWISE)
    assert "none: User Mode Linux does not boot: Checking that ptrace" in found.said
    assert "Operation not permitted" in found.said
    assert found.boots == ["probe"]


def test_a_kernel_that_boots_into_nothing_is_our_own_fault_and_nothing_to_skip(tmp_path: Path) -> None:
    ended = 'echo "Kernel panic - not syncing: Attempted to kill init! exitcode=0x00000200"; exit 134'
    assert tried(tmp_path, ended).said.startswith("refused: User Mode Linux boots, but tests/guest/init")


def test_a_kernel_that_says_nothing_is_told(tmp_path: Path) -> None:
    assert "none: User Mode Linux does not boot: it said nothing" in tried(tmp_path, "exit 1").said


@needs_compiler
def test_the_help_may_be_asked_for(tmp_path: Path) -> None:
    found = tried(tmp_path, HELPED, GUEST_WIDE_FP="1")
    assert found.said == f"found: {tmp_path}/wide_fp_state.so\n"


@needs_compiler
def test_a_computer_may_be_made_like_one_with_amx(tmp_path: Path) -> None:
    found = tried(tmp_path, HELPED, GUEST_LIKE_AMX="1")
    assert found.said.endswith(f"found: {tmp_path}/wide_fp_state.so:{tmp_path}/like_amx.so\n")
