"""Blocks to the way of tool and joints: cuts, approaches, lines, branches, audits."""
