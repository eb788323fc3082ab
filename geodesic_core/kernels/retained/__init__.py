"""What a sweep retained: its windows by face, and the regions of a face that they reach."""
