"""Small games, faster: one round of a game is traced and written out as straight-line Python, see `rounds`."""
