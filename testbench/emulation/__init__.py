"""Emulated hardware that answers real client libraries, for rehearsals and tests without an arm."""
