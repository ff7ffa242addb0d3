"""Games for the command play: what they measure for each group of agents."""
