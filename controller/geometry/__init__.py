"""Curves, surfaces, rulings, poses and the place of the cutter: exact formulas, on floats and on arrays."""
