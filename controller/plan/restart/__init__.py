"""Start inside of a program: the place, the state there, the way to it."""
