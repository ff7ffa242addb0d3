"""Other libraries as clients of the environments, each with its own code and its own virtual environment.

Each file is a client with its `CHECKS`, and imports packages of its virtual environment.
`python -m roletrust_experiments.clients` creates these environments and reports the checks that pass.
"""
