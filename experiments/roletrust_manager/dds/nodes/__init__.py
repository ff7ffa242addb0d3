"""The processes of a team: cameras, raters and the manager. Each runs until it receives SIGTERM or
Ctrl-C.
"""
