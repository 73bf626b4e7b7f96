"""A Universal Robots controller on loopback: dashboard, script ports, RTDE, moving joints."""
