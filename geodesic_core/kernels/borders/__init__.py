"""Borders of territories: lines between the parts of the surface nearest to each source."""
