"""Robots: the nodes of a team, alone or together as the demo."""
