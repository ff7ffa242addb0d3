"""The commands of `roletrust`: what each asks, checks and prints."""
