"""Readers of makers' and datasets' own files, one module each."""
