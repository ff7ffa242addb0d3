"""Files: written whole or not at all, with what made them, and read with caution."""
