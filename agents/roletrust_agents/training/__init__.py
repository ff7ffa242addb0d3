"""Training of attackers: the loop, the learners, and the folders of runs."""
