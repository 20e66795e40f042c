"""Ways onto the virtual bus for tools that know other protocols. Off unless asked for."""
