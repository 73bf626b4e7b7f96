"""From the orientations of two sensors to the angles of the joint between them."""
