"""Scripted attacks of several agents that know each other."""
