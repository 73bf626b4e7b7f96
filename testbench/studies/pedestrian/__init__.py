"""Steps and path of a walker, reference 4."""
