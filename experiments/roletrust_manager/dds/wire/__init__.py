"""Messages, their signatures, and DDS as ROS 2 uses it. Needs the extra `robots`."""
