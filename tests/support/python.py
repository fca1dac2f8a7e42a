"""Another Python that imports what this one does."""

import os
import subprocess
import sys


def python(*words, env=(), check=False, stderr=subprocess.PIPE, cwd=None):
    """Run Python with these words: what it printed, and its exit code."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), **dict(env)}
    how = {"stdout": subprocess.PIPE, "stderr": stderr, "text": True, "timeout": 300.0}
    return subprocess.run([sys.executable, *map(str, words)], env=environment, check=check, cwd=cwd, **how)
