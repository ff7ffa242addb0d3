"""What the paper claims or leaves open, answered: a file for each question, and the rules by which answers are worded."""
