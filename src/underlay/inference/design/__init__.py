"""Design of a test: what it can tell, which one would tell it, and which second one."""
