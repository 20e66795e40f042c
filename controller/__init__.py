"""Directrix: a five-axis CNC controller that interpolates ruled surfaces themselves."""
