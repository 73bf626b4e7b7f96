"""Inertial sensors."""
