"""The learners' benchmark: who finds the best attack on the four tasks, and with how many rounds of play."""
