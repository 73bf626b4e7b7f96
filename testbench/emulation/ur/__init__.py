"""A Universal Robots controller on loopback: dashboard, script ports and RTDE, with joints that
move like an arm's.
"""
