"""An emulated controller of UFACTORY xArm robots."""
