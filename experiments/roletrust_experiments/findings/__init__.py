"""What the paper claims or leaves open: a file for each question, and the rules by which answers are worded."""
