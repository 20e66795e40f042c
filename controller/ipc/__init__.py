"""How values travel between the processes: pieces, requests, rows, and the control socket."""
