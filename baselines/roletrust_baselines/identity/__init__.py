"""Scripted attacks by owners of several identities."""
