"""All ways to attack a task under one interface and one budget."""
