"""Retained windows of a sweep, by face, and the regions of a face that they reach."""
