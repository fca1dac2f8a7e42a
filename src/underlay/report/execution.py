"""Execute a notebook with the Python that runs this, and say in one line what stopped it."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from typing import Any

from underlay.errors import FitError
from underlay.report.notebook import report_library

__all__ = ["execute", "import_path"]

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
    try:
        with tempfile.TemporaryDirectory(prefix="underlay-") as own, (Path(own) / "log").open("w") as log:
            runner = client.NotebookClient(notebook, km=_kernel_manager(own, folder), timeout=_LONGEST_CELL)
            # What the kernel says of itself is not what a user asked for. It is ours, so the runner ends it.
            runner.execute(cwd=own, env=_environment(own, folder), stderr=log, cleanup_kc=True)
    except client.exceptions.CellExecutionError as error:
        raise FitError(f"the notebook of the report stopped: {error.ename}: {error.evalue}") from error
    except client.exceptions.DeadKernelError as error:
        raise FitError(f"the Python that makes the report ended: {error}") from error
    except client.exceptions.CellTimeoutError as error:
        raise FitError(
            f"a cell of the report ran longer than {_LONGEST_CELL} s; run the notebook by hand"
        ) from error
    return notebook


# Variables that have a Python run something else first, or go on after its program.
_NOT_HANDED_ON = frozenset({"PYTHONSTARTUP", "PYTHONINSPECT"})


def _environment(own: str, folder: Path) -> dict[str, str]:
    """Environment of the kernel: the caller's, but nothing that lies in a folder of data is imported or run."""
    theirs = {name: value for name, value in os.environ.items() if name not in _NOT_HANDED_ON}
    return theirs | {
        "PYTHONPATH": os.pathsep.join(import_path(folder)),
        # Python then does not put the folder it is started in on its path; what it starts inherits that.
        "PYTHONSAFEPATH": "1",
        "MPLBACKEND": "module://matplotlib_inline.backend_inline",
        # An empty profile: no start-up files and no settings of the user's own notebooks.
        "IPYTHONDIR": os.path.join(own, "ipython"),  # noqa: PTH118  a name, not a file
    }


def import_path(folder: Path) -> list[str]:
    """Search path of this process, so that the kernel imports the same packages, without folders of data.

    Left out are `folder`, the working directory, that of the script that runs, and relative entries: a
    ``pandas.py`` that lies beside a curve is not pandas. The folder underlay was loaded from comes last.
    """
    script = getattr(sys.modules.get("__main__"), "__file__", None)
    data = {folder.resolve(), Path.cwd().resolve()} | ({Path(script).resolve().parent} if script else set())
    own = Path(__file__).resolve().parents[2]
    entries = [Path(entry) for entry in sys.path if entry]
    found = [entry for entry in entries if entry.is_absolute() and entry.resolve() not in data | {own}]
    return [os.fspath(entry) for entry in (*found, own)]


def _kernel_manager(own: str, folder: Path) -> Any:
    """Manager of a kernel of this very Python: an installed kernel named python3 may be another one's."""
    manager = report_library("jupyter_client.manager")
    spec = report_library("jupyter_client.kernelspec")
    command = [sys.executable, "-m", "underlay.report.kernel", os.fspath(folder), "-f", "{connection_file}"]
    # All that the two say to each other stays in a folder of their own.
    kernel = manager.AsyncKernelManager(connection_file=os.path.join(own, "kernel.json"))  # noqa: PTH118  a name
    if os.name == "posix":
        # Sockets in the file system: no port is opened for a report.
        kernel.transport, kernel.ip = "ipc", os.path.join(own, "kernel")  # noqa: PTH118  a prefix, not a file
    kernel._kernel_spec = spec.KernelSpec(argv=command, display_name="underlay", language="python")  # noqa: SLF001  no public way to name a command
    return kernel
