"""Small games, faster: a round is traced and written out as straight-line Python, and in C, see
`rounds`.
"""
