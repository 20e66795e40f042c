"""The panel: REST, page, program store and serial line; an unprivileged process of its own."""
