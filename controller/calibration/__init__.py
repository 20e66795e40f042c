"""A machine's own geometry, and how a part lies on it, from what was measured.

Slow side, values and functions: touches, targets and recordings go in; what is off, how sure that is, and
what to write come out. ``machine_edit`` is the one file that writes.
"""

DOFS = "XYZABC"  # of a fitted part: moves along X Y Z, then turns about them
MAX_MM, MAX_DEG = 1.0, 0.3  # by which a rotary may move where nothing else is said
