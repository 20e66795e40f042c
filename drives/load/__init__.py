"""Bus time: every frame of a tick counted to the bit before anything is opened."""
