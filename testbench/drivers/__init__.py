"""The outside world, live: arms and inertial sensors, simulated or real."""
