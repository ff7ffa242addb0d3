"""Attacks that are computed: by gradients through the game, and exactly by dynamic programming."""
