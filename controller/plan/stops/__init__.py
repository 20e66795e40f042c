"""Stops worked out ahead, from every moment of a plan."""
