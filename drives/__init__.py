"""CANopen CiA 402 drives: the bus, the profile, commissioning, and simulated drives."""
