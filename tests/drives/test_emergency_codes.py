"""Emergency codes in words."""

from __future__ import annotations

import pytest

from drives import emergency_codes
from drives.texts import english


@pytest.mark.parametrize(
    ("code", "said"),
    [
        (0x8611, "8611h: following error"),
        (0x8612, "8612h: reference limit: beyond a limit switch or a position limit"),
        (0x8130, "8130h: life guard or heartbeat error: the controller was silent"),
        (0x2311, "2311h: continuous overcurrent of the motor"),  # its subgroup
        (0x23F7, "23F7h: current on the device's output side"),  # its group
        (0x7F00, "7F00h: additional modules"),  # its class
        (0xFF37, "FF37h: specific to the device"),
        (0x0001, "0001h: error gone"),
        (0xA123, "A123h: not in CiA 301 or CiA 402, see the drive's manual"),
    ],
)
def test_a_code_is_said_by_the_nearest_class_that_the_standards_know(code: int, said: str) -> None:
    assert english(emergency_codes.text(code)) == said


def test_every_code_of_two_bytes_has_a_sentence_that_names_it() -> None:
    for code in range(0x10000):
        assert english(emergency_codes.text(code)).startswith(f"{code:04X}h: ")
