"""The process beside the page: answers, refusals, faults, deaths, stops; and the end of its parent."""

import asyncio
import os
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from underlay.app.work import Worker, WorkError

TASKS = "support.worker_tasks:Tasks"


def test_a_worker_answers_refuses_fails_dies_and_lives_on():
    async def scenario():
        worker, heard = Worker(TASKS, "hello"), []
        try:
            assert await worker.call("say", "there", heard=heard.append) == "hello there"
            assert heard == ["hello ..."]
            first = worker.process_id
            with pytest.raises(WorkError, match="depth must be positive"):
                await worker.call("refuse")
            with pytest.raises(WorkError, match=r"fault of underlay \(ZeroDivisionError"):
                await worker.call("break_down")
            assert worker.process_id == first
            with pytest.raises(WorkError, match=r"\(die\) ended without a word \(code 3\)"):
                await worker.call("die")
            assert await worker.call("say", "again") == "hello again"
            assert worker.process_id != first
        finally:
            worker.stop()

    asyncio.run(scenario())


def test_a_task_that_tells_is_asked_to_stop_and_one_that_sleeps_is_ended():
    async def scenario():
        worker, heard = Worker(TASKS, "hello"), []
        try:
            going = asyncio.create_task(worker.call("go_on", heard=heard.append))
            while len(heard) < 3:  # noqa: ASYNC110  what is waited for is told through a pipe
                await asyncio.sleep(0.01)
            process = worker.process_id
            worker.ask_to_stop()
            with pytest.raises(WorkError, match="stopped"):
                await going
            # It was asked, not killed; and a stop that comes too late stops nothing.
            assert await worker.call("say", "on") == "hello on"
            assert worker.process_id == process
            sleeping = asyncio.create_task(worker.call("sleep"))
            await asyncio.sleep(0.1)
            worker.stop()
            with pytest.raises(WorkError, match="stopped"):
                await sleeping
        finally:
            worker.stop()

    asyncio.run(scenario())


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks for the process in /proc")
def test_a_worker_ends_with_a_parent_that_was_killed():
    code = """
        import asyncio, os, signal
        from underlay.app.work import Worker

        async def scenario():
            worker = Worker("support.worker_tasks:Tasks", "hello")
            await worker.call("say", "there")
            print(worker.process_id, flush=True)
            asyncio.create_task(worker.call("sleep"))
            await asyncio.sleep(0.2)
            os.kill(os.getpid(), signal.SIGKILL)

        asyncio.run(scenario())
    """
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    assert done.returncode == -9
    worker = Path("/proc") / done.stdout.strip()
    for _ in range(500):
        # Without a parent that waits for it, what is left of a process may be its number alone.
        if not worker.exists() or "State:\tZ" in (worker / "status").read_text():
            return
        time.sleep(0.02)
    pytest.fail("the worker outlived its parent")
