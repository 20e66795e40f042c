"""Off line: what was cut or will be cut, held against what was asked for."""
