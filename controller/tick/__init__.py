"""The real-time side: one tick every period, no lock, no log, no exception across it."""
