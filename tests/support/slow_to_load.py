"""A module that takes its time to load, as a library of numbers does on a machine that is busy."""

import time

SECONDS = 3.0
time.sleep(SECONDS)
