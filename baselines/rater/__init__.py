"""Scripted attacks by ratings."""
