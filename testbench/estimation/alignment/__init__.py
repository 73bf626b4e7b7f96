"""Clocks stay apart; here frames and mountings of sensors are brought into those of the truth."""
