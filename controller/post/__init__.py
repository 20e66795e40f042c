"""What a CAM system would have written: a planned path as short G1 lines."""
