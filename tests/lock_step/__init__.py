"""Bench, driving process and emulated controller in one process, on one clock that no machine can
delay.
"""
