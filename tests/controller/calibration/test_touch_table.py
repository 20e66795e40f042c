"""The table of touches: what is read, and what is refused with its line and column."""

from __future__ import annotations

import math

import pytest

from controller import messages
from controller.calibration import touch_table
from controller.calibration.refusal import Refusal
from controller.machine import machine_file

TRUNNION = machine_file.load("trunnion")
HEAD = "X,Y,Z,A,C,i,j,k,length_mm,radius_mm"
ROW = "1,2,3,90,-45,0,0,-1,100,3"


def read(*lines):
    return touch_table.read("\n".join(lines), TRUNNION, "own.csv")


def test_joints_are_read_in_degrees_and_senses_of_the_way_where_none_are_told():
    found = read(f"{HEAD},feature,note", f"{ROW},sphere,left alone")
    assert found.joints[0] == pytest.approx([1, 2, 3, math.pi / 2, -math.pi / 4])
    assert list(found.senses[0]) == [0, 0, -1, 0, 0] and found.features == ("sphere",)


def test_senses_that_are_told_go_before_those_of_the_way():
    found = read(f"{HEAD},from_X,from_Z,from_C", f"{ROW},-1,1,1")
    assert list(found.senses[0]) == [-1, 0, 1, 0, 1]


def test_positions_are_those_of_the_rotaries():
    found = read(HEAD, ROW, ROW.replace("90", "80"), ROW)
    assert [list(rows) for rows in touch_table.positions(found, TRUNNION.rotary())] == [[0, 2], [1]]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_end_as_any_system_ends_them(end: str) -> None:
    found = touch_table.read(end.join((HEAD, ROW, ROW)) + end, TRUNNION, "own.csv")
    assert len(found) == 2


WRONG = [
    ((HEAD.replace(",k", ""), ROW), "line 1: the column k is missing"),
    ((HEAD,), "has 0 rows"),
    ((HEAD, ROW, ROW.replace("100", "long")), "line 3, column length_mm: 'long' is no number"),
    ((HEAD, ROW.replace("100", "inf")), "column length_mm"),
    ((HEAD, ROW.replace("-1,100", "-1.5,100")), "line 2: i j k has the length 1.5"),
    ((HEAD, "1,2"), "line 2, column Z"),
    ((HEAD, ROW.replace("-45", "-" + "4" * 200_000)), "line 2: is no table of comma-separated values"),
]


@pytest.mark.parametrize(("lines", "what"), WRONG)
def test_a_wrong_table_is_refused_where_it_is_wrong(lines, what):
    with pytest.raises(Refusal) as refused:
        read(*lines)
    assert what in str(refused.value) and str(refused.value).startswith("own.csv")
    assert messages.text(refused.value.said, "de") != str(refused.value)


def test_of_a_fast_and_a_slow_touch_the_slow_one_counts_and_none_is_no_touch() -> None:
    head = "touched,X,Y,Z,A,C,i,j,k,feed_mm_min,length_mm,radius_mm"
    rows = [
        "1,10.004,0,0,0,0,1,0,0,300,77,3",
        "1,10.001,0,0,0,0,1,0,0,30,77,3",
        "0,20,0,0,0,0,0,0,-1,300,77,3",
        "1,10.002,9,0,0,0,1,0,0,300,77,3",
    ]
    found = touch_table.read("\n".join([head, *rows]), machine_file.load("trunnion"), "own.csv")
    assert [row[:2] for row in found.joints.tolist()] == [[10.001, 0.0], [10.002, 9.0]]
