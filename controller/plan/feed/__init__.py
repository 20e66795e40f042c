"""How fast along the way: limits of the joints, and the fastest motion law within them."""
