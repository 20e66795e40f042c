"""Frames as candump writes them, and the last seconds of a bus."""
