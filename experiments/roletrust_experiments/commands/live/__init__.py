"""`roletrust live`: cameras, raters and a manager as processes, on ROS 2's middleware."""
