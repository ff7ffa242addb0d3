"""Scripted attacks on the quality of services."""
