"""From CAD: the ruled faces of a STEP file as a part program."""
