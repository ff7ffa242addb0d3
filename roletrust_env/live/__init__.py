"""The live system: the same trust models on a network, with cameras, raters and a manager as
separate processes.
"""
