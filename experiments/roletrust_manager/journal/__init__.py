"""What a manager keeps: a file of lines for robots, and a database for agents on HTTP."""
