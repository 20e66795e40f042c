"""How a new machine is brought up: step by step, each with what to look at, and what came of it on record."""
