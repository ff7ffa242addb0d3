"""Rendering of games as text, as pictures or in a window."""
