"""The faces of the game: PettingZoo, Gymnasium and Stable-Baselines3. They own no rule."""
