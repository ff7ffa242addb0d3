"""What the paper claims or leaves open: a file for each question, and how they are answered."""
