"""Other libraries of geodesic distances, side by side with this one."""
