"""Directrix: a five-axis CNC controller that interpolates ruled surfaces themselves."""

__version__ = "0.1.0"
