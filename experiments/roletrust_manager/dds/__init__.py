"""The manager of robots on DDS, as ROS 2 uses it, with cameras and raters as processes."""
