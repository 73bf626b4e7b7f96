"""What a person writes: protocols, robots, sensors, calibrations."""
