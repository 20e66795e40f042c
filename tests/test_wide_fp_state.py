"""The library under a guest's kernel whose buffer is smaller than the processor's floating-point state.

Any x86-64 with AVX stands for one with AMX: its own kernel refuses to set a part of NT_X86_XSTATE. Where
the set shall be as large as with AMX, ``like_amx.c`` makes it so.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

SOURCES = Path(__file__).parent / "guest"
COMPILER = shutil.which(os.environ.get("CC", "cc"))
HEADER_END = 576  # of the set: legacy region and header (Intel SDM 1, 13.4), without the upper halves of YMM
OF_THE_GUEST = 2696  # what User Mode Linux 6.1 hands over
WITH_AMX = 11008
OLD, NEW = "11" * 16, "77" * 16

Traced = Callable[..., dict[str, str]]


def has_avx() -> bool:
    flags = Path("/proc/cpuinfo")
    return flags.exists() and " avx " in flags.read_text()


pytestmark = pytest.mark.skipif(
    COMPILER is None or os.uname().machine != "x86_64" or not has_avx(),
    reason="needs a C compiler and an x86-64 processor with AVX",
)


@pytest.fixture(scope="module")
def traced(tmp_path_factory: pytest.TempPathFactory) -> Traced:
    """Runs traced_child with so many bytes over these libraries: what it says, by request."""
    built = tmp_path_factory.mktemp("built")
    warn = [str(COMPILER), "-Wall", "-Wextra", "-Werror"]
    for name in ("wide_fp_state", "like_amx"):
        source = SOURCES / f"{name}.c"
        subprocess.run([*warn, "-O2", "-shared", "-fPIC", "-o", built / f"{name}.so", source], check=True)
    subprocess.run([*warn, "-O1", "-o", built / "traced_child", SOURCES / "traced_child.c"], check=True)

    def run(bytes_: int, *libraries: str) -> dict[str, str]:
        preload = ":".join(f"{built}/{name}.so" for name in libraries)
        done = subprocess.run(
            [built / "traced_child", str(bytes_)],
            env={**os.environ, "LD_PRELOAD": preload, "LC_ALL": "C"},
            capture_output=True,
            text=True,
            check=True,
        )
        return _said(done.stdout)

    return run


def _said(text: str) -> dict[str, str]:
    """Result and error of each request, with what belongs to it, and the child's registers."""
    said: dict[str, str] = {}
    name = ""
    for line in text.splitlines():
        key, _, value = line.partition(" " if line.startswith("ymm0") else ":")
        name = f"{name}{key}" if key.startswith("  ") else key
        said[name] = value.strip()
    return said


def ymm0(said: dict[str, str]) -> list[str]:
    """Its lower and its upper half, as the child had them in the end."""
    return said["ymm0"].split()[:2]


def test_this_kernel_refuses_a_part_of_the_set(traced: Traced) -> None:
    """Else the others would show nothing."""
    said = traced(HEADER_END)
    assert said["set state"].endswith("Bad address")
    assert ymm0(said) == [OLD, OLD]
    assert traced(OF_THE_GUEST, "like_amx")["set state"].endswith("Bad address")


def test_a_part_is_set_and_the_rest_stays_the_childs_own(traced: Traced) -> None:
    said = traced(HEADER_END, "wide_fp_state")
    assert said["set state"] == "0"
    assert said["set state  bytes"] == f"{HEADER_END:x}"  # as the caller handed it over
    assert ymm0(said) == [NEW, OLD]


@pytest.mark.parametrize("bytes_", [HEADER_END, OF_THE_GUEST, WITH_AMX])
def test_a_set_as_large_as_with_amx_is_completed(traced: Traced, bytes_: int) -> None:
    said = traced(bytes_, "wide_fp_state", "like_amx")
    assert said["get state  bytes"] == f"{WITH_AMX:x}"
    assert said["set state"] == "0"
    assert ymm0(said)[0] == NEW


def test_a_whole_set_and_all_other_requests_are_the_kernels(traced: Traced) -> None:
    """Results and errors, those of a child that is no more included."""
    said = traced(WITH_AMX)
    assert said["set state of nobody"].endswith("No such process")
    assert said["peek nowhere"].endswith("Input/output error")
    assert traced(WITH_AMX, "wide_fp_state") == said


def test_the_error_of_a_part_that_cannot_be_set_is_the_kernels(traced: Traced) -> None:
    assert traced(HEADER_END, "wide_fp_state")["set state of nobody"].endswith("No such process")
