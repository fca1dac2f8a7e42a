"""The posterior by emcee: where walkers start, how long they go, what is kept and what it means."""
