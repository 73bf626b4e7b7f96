"""A session: its manifest, samples, plan and trajectory."""
