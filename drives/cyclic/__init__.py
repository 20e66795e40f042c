"""What runs every tick: frames in, frames out, what is wrong, as values. Held to the tick's rules."""
