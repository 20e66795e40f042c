"""The machine file and what it says: axes, kinematics, tools, offsets, drives; and what was set up since."""
