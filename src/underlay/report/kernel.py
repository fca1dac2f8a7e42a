"""The Python process that executes a report's notebook: ``python -m underlay.report.kernel FOLDER -f CONNECTION``.

It is started in an empty folder and works in FOLDER, where the notebook and its files are. No module in FOLDER is
imported, and no file there is read as a setting.
"""

from __future__ import annotations

import os
import sys

# matplotlib takes its settings from the folder in which it is first imported: here the empty one.
import matplotlib as mpl  # noqa: F401  its settings
from ipykernel.kernelapp import IPKernelApp

__all__ = ["main"]


def main(words: list[str]) -> None:
    """Run the Jupyter kernel that executes one notebook, until it is ended.

    Parameters
    ----------
    words : list of str
        The folder to work in, then the arguments of the kernel.
    """
    folder, *told = words
    os.chdir(folder)
    # The folder is not put on the path, nor is what a user's own sessions remember.
    IPKernelApp.launch_instance(
        [*told, "--InteractiveShellApp.ignore_cwd=True", "--HistoryManager.enabled=False"]
    )


if __name__ == "__main__":
    main(sys.argv[1:])
