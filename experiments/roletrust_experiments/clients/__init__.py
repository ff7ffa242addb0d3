"""Other libraries as clients: each tries the environments with its own code, in an environment of its own.

A file here is a client and its `CHECKS`. It imports what only its own environment has;
`python -m roletrust_experiments.clients` makes these environments and says what passed.
"""
