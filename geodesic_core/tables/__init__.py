"""Tables of distances of any size, written to files row by row."""
