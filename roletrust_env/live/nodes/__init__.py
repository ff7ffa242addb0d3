"""The robots' processes: cameras, raters that look at them, and the manager. Each runs until it is told to stop."""
