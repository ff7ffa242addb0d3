"""Learners in one file each, to read and to copy."""
