"""What both rotaries do along a path: branch, turns, tool vectors."""
