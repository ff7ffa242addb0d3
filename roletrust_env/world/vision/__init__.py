"""The service of the paper: camera frames, OpenCV's people detector, and the probability of a
person.

This package is the only part of the library that imports OpenCV. It is imported only for scenarios
with camera frames.
"""
