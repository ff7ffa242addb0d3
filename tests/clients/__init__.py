"""Other libraries as clients of the environments, each with a file of its own and a virtual
environment of its own."""
