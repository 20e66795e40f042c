"""The bench: simulated devices of a machine, what they touch and cut, and what is done to them."""
