"""The environments: the game for PettingZoo, Gymnasium and Stable-Baselines3. They contain no rule
of the game.
"""
