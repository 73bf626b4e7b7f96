"""Truth from files: orientations of a reference system, and logs of a robot."""
