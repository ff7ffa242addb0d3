"""Answers to what the paper claims or leaves open: a file for each question, and the rules that word the answers."""
