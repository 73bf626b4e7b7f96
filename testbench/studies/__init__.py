"""Studies: experiments of several sessions, such as those of published works, with their tables beside ours."""
