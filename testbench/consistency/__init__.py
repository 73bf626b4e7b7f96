"""Self-consistency: whether the quantities of a sensor can all be what they are taken for."""
