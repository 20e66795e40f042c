"""The virtual bus: bit timing, error counters, faults by script, and its hub for other processes."""
