"""What files seem to be: the formats that read them, and a mapping to begin with.

Titles and names tell quantities and units; where they do not, gravity at rest, the turns, the
strength of the field and the rates that sensors have do.
"""
