"""What one block does along its own length, and the pieces of it that the plan hands to the tick."""
