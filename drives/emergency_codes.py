"""Emergency error codes in words: CiA 301 table 26 (classes) and CiA 402-2 table 4 (drives).

A code that is not listed belongs to the class of its first three, two or one hexadecimal
digits; FFxxh and what no class covers is the manufacturer's own, in the drive's manual.
"""

from __future__ import annotations

from drives.texts import Key, Message, message

LISTED = """
    0000 1000 2000 2100 2110 2120 2130 2200 2211 2212 2213 2214 2220 2230 2240 2250 2300 2310
    2320 2330 2340 2350 3000 3100 3110 3120 3130 3140 3200 3210 3220 3230 3300 3310 3320 3330
    4000 4100 4110 4120 4200 4210 4220 4300 4310 4320 4400 5000 5100 5110 5200 5300 5400 5430
    5440 5441 5450 5500 5530 6000 6010 6100 6200 6300 6320 7000 7100 7110 7120 7121 7122 7200
    7300 7305 7306 7310 7320 7380 7400 7500 7600 8000 8100 8110 8120 8130 8140 8150 8200 8210
    8220 8230 8240 8250 8300 8311 8331 8400 8500 8600 8611 8612 8700 8800 8900 8A00 9000 F000
    F001 F002 F003 F004 FF00
"""
CODES = frozenset(int(word, 16) for word in LISTED.split())  # each has a text, ``emcy.8611`` for one
KEPT_DIGITS = (0xFFFF, 0xFFF0, 0xFF00, 0xF000)


def listed(code: int) -> int | None:
    """The code, or else its class, of which there is a text; None where there is none."""
    return next((code & mask for mask in KEPT_DIGITS if code & mask in CODES), None)


def text(code: int) -> Message:
    """'8611h: following error'; an unlisted code has the text of its class, and says so by its digits."""
    known = listed(code)
    what = Key("emcy.unlisted" if known is None else f"emcy.{known:04X}")
    return message("emcy_code", code=code, what=what)
