"""A scenario from a recording of a real team."""
