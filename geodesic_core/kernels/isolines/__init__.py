"""Level sets of the distance, face by face, joined to lines."""
