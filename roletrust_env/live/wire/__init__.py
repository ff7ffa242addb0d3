"""The network layer: messages, their signatures, and DDS as ROS 2 uses it. Needs the extra
`live`.
"""
