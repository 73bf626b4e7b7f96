"""Studies: experiments on the bench that are more than one session, or none at all; each returns tables and curves."""
