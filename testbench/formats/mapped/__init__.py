"""Sensors as a mapping describes them: from files and columns to samples and truth."""
