"""The game: its state, one round, what each agent may see, how agents play, and one attacker's side
of it.
"""
