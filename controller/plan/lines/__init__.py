"""G0 to G3 and tool lines: rows of them, exact or as smooth splines."""
