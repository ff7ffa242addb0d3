"""Pictures: each is given rows and gives back a figure."""
