"""How good attackers are: the worst case by the rounds of their search, and their transfer to other trust models."""
