"""Madgwick's gains on the lower limb, reference 2."""
