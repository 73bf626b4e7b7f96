"""The sentences of findings, by subject: what is seen, what it means, how to say otherwise."""
