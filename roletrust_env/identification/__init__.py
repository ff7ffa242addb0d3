"""Identification of a scenario from the recording of a real team."""
