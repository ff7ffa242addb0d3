"""Policies that play, learn or plan."""

from roletrust_agents.honest import Honest

__all__ = ["Honest"]
