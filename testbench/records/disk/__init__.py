"""Tables, journals, JSON and YAML on disk, each replaced atomically."""
