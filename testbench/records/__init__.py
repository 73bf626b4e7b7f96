"""Nouns: what a person writes, and what the stages hand to one another."""
