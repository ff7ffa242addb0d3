"""What a person sees of a game: a text, a picture or a window."""
