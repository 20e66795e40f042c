"""The parts of commissioning over SDO; the verbs are in ``drives.commission``."""
