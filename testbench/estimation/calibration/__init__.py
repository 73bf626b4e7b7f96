"""Calibration: the sensor errors that a recording shows."""
