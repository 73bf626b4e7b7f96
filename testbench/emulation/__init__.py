"""Emulations of hardware that answer real client libraries over real connections, to rehearse and
to test without an arm.
"""
