"""Measurements of speed and of costs."""
