"""What the service keeps of a machine: one SQLite file, which it alone writes and others read."""
