"""Honest service as a best response: what providers and raters learn under each trust model, and what it is worth."""
