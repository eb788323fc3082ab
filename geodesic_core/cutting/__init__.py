"""Meshes cut along curves."""
