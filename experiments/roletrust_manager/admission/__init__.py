"""Who may rate, and which messages count, on every wire."""
