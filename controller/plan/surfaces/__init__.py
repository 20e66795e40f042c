"""Ruled surfaces: cuts, placements, joints, leads and links between them, and their audit."""
