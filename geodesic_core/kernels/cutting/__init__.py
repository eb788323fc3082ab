"""Cutting: triangulations of single faces in which given segments are edges."""
