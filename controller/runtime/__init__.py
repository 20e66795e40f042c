"""The parts put together: on the stepped clock in one process, or live in several."""
