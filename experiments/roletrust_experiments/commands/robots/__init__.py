"""`roletrust robots`: cameras, raters and a manager as processes, on the middleware of ROS 2."""
