"""Ways onto a bus, one small class each; ``drives.bus`` opens them."""
