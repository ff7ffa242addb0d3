"""Honest agents that are learners, too: strategies, how they learn, and what deviating brings."""
