"""Lines and arcs in a plane: the circle that an arc's words mean, and the cutter's way beside a contour."""
