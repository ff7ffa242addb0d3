"""The trust manager on HTTP, for agents that are no robots, and its clients."""
