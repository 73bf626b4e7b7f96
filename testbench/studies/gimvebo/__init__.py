"""Integrators in gyroscope calibration, reference 3."""
