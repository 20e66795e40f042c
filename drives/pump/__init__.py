"""The stock of setpoints below the tick, and the pump that plays it."""
