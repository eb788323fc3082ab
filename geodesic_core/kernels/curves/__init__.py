"""Curves in faces, and lines across faces: whatever they are the curves of."""
