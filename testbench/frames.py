"""Frames and constants that every part of the bench shares; drawn in docs/frames.md.

world z up; gravity along -z. The arm's kinematics, and so the truth, are expressed in it. base the
arm's base link; the robot file places it in the world. <link> the frames of the URDF, by their name
there. segment the part of a body that a sensor stands for; fixed to a link. sensor the axes printed
on the sensor's housing; fixed to a link by its mounting. earth z up, heading unknown: what an
orientation filter reports; ENU when the filter uses a magnetometer.
"""

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of free fall [m/s^2] (3rd CGPM, 1901)."""

NANOSECONDS = 1_000_000_000
"""Nanoseconds in a second; times are int64 nanoseconds."""
