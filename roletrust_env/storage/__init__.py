"""Files: atomic writing, provenance, and cautious reading."""
