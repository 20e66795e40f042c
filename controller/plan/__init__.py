"""Everything that is decided ahead of the tick: words, blocks, path, limits, profile."""
