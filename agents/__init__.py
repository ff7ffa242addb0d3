"""Policies that play, learn or plan."""

from agents.honest import Honest

__all__ = ["Honest"]
