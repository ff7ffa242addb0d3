"""Scripted attacks by coalitions of agents."""
