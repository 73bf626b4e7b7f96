"""Timing of the hot paths, beside what others offer for the same task: `make bench`. Nothing here
is asserted.
"""
