"""The kinematic-chain filter on the lower limb, reference 5."""
