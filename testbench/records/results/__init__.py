"""What estimation, evaluation, calibration, studies and tuning come to."""
