"""Short summaries of what was found, for people's pull requests and for build servers."""
