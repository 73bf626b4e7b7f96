"""What every recording passes first: access, quality, rates, timing, still intervals."""
