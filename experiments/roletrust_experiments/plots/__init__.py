"""Figures from rows of results."""
