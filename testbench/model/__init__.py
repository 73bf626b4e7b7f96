"""Physics: rotations, kinematics, what inertial sensors measure, and their noise."""
