"""What a person runs: the command line `roletrust` and the experiments behind it."""
