"""Makers' data sheets, which are not ours to ship: tests find them through DIRECTRIX_EDS, or are skipped."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

SHEETS = {  # profile: file
    "elmo": "elmo_simpliq.dcf",
    "maxon_epos4": "maxon_epos4_50_5.eds",
    "pilz_prbt": "pilz_prbt.dcf",
    "technosoft_ipos": "technosoft_ipos.eds",
    "trinamic_tmcm1636": "trinamic_tmcm1636.eds",
}


def sheet_of(profile: str) -> str:
    """Path of the data sheet that belongs to a shipped profile; skips the test where it is not there."""
    folder = os.environ.get("DIRECTRIX_EDS")
    if not folder:
        pytest.skip("DIRECTRIX_EDS names no folder of makers' data sheets")
    path = Path(folder) / SHEETS[profile]
    if not path.is_file():
        pytest.skip(f"there is no {path}")
    return str(path)
