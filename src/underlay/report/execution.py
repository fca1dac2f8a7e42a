"""Execute a notebook with the Python that runs this, and say in one line what stopped it."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from typing import Any

from underlay.errors import FitError
from underlay.report.notebook import report_library

__all__ = ["execute"]

# A cell that takes longer than this hangs; the slowest cell of a report takes seconds.
_LONGEST_CELL = 600


def execute(notebook: Any, folder: Path) -> Any:
    """Run all cells of a notebook in `folder` and return it with its outputs.

    Raises
    ------
    MissingExtraError
        If the extra ``report`` is not installed.
    FitError
        If a cell fails; says which error it was.
    """
    client = report_library("nbclient")
    report_library("ipykernel")
    environment = {**os.environ, "PYTHONPATH": _path(), "MPLBACKEND": _BACKEND}
    try:
        with tempfile.TemporaryDirectory(prefix="underlay-") as own, (Path(own) / "log").open("w") as log:
            runner = client.NotebookClient(notebook, km=_kernel_manager(own), timeout=_LONGEST_CELL)
            # What the kernel says of itself is not what a user asked for. It is ours, so the runner ends it.
            runner.execute(cwd=os.fspath(folder), env=environment, stderr=log, cleanup_kc=True)
    except client.exceptions.CellExecutionError as error:
        raise FitError(f"the notebook of the report stopped: {error.ename}: {error.evalue}") from error
    except client.exceptions.DeadKernelError as error:
        raise FitError(f"the Python that makes the report ended: {error}") from error
    except client.exceptions.CellTimeoutError as error:
        raise FitError(
            f"a cell of the report ran longer than {_LONGEST_CELL} s; run the notebook by hand"
        ) from error
    return notebook


_BACKEND = "module://matplotlib_inline.backend_inline"


def _path() -> str:
    """Search path of this process, so that the kernel imports the same underlay."""
    return os.pathsep.join(entry for entry in sys.path if entry)


def _kernel_manager(sockets: str) -> Any:
    """Manager of a kernel of this very Python: an installed kernel named python3 may be another one's."""
    manager = report_library("jupyter_client.manager")
    spec = report_library("jupyter_client.kernelspec")
    command = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
    kernel = manager.AsyncKernelManager()
    if os.name == "posix":
        # Sockets in the file system: no port is opened for a report.
        kernel.transport, kernel.ip = "ipc", os.path.join(sockets, "kernel")  # noqa: PTH118  a prefix, not a file
    kernel._kernel_spec = spec.KernelSpec(argv=command, display_name="underlay", language="python")  # noqa: SLF001  no public way to name a command
    return kernel
