"""The process beside the page: answers, refusals, faults, deaths, stops; and the end of its parent."""

import asyncio
import sys
import textwrap
import time
from pathlib import Path

import pytest

from support.python import python
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


# Run by itself: where another test started a process before, all is loaded.
_FIRST_START = """
    import asyncio, time
    from underlay.app import work

    work._LOADED = ("support.slow_to_load",)

    async def scenario():
        workers = [work.Worker("support.worker_tasks:Tasks", "hello") for _ in range(2)]
        longest, last, began = 0.0, time.monotonic(), time.monotonic()
        calls = [asyncio.create_task(worker.call("say", "there")) for worker in workers]
        {meanwhile}
        while not all(call.done() for call in calls):
            await asyncio.sleep(0.01)
            longest, last = max(longest, time.monotonic() - last), time.monotonic()
        told = [str(call.exception() or call.result()) for call in calls]
        if {again}:
            told.append(await workers[0].call("say", "again"))
        for worker in workers:
            worker.close()
        print(told, longest, time.monotonic() - began, "__main__" in __import__("sys").modules["__main__"].__name__)

    asyncio.run(scenario())
"""


def first_start(meanwhile="", *, again=False):
    """What two workers told, the longest time (s) in which nothing else was done, and the time (s) of all."""
    code = textwrap.dedent(_FIRST_START).format(meanwhile=meanwhile or "pass", again=again)
    done = python("-c", code, check=True)
    told, _, numbers = done.stdout.rpartition("] ")
    longest, whole, is_main = numbers.split()
    assert is_main == "True"
    return told, float(longest), float(whole)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere nothing is loaded before a process is there")
def test_the_page_answers_while_the_first_process_loads():
    told, longest, whole = first_start()
    assert told.count("hello there") == 2
    assert whole > 2.9  # what is loaded takes three seconds, so there was something to wait for
    assert longest < 1.0


@pytest.mark.parametrize("how", ["stop", "ask_to_stop"])
def test_a_start_that_is_not_through_is_stopped_and_the_next_call_begins_anew(how):
    told, longest, _ = first_start(f"await asyncio.sleep(0.3); workers[0].{how}()", again=True)
    assert "stopped; what was finished is kept" in told
    assert told.count("hello there") == 1
    assert "hello again" in told
    assert longest < 1.0


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
    # The worker holds a pipe of errors for as long as it lives.
    done = python("-c", textwrap.dedent(code), stderr=None)
    assert done.returncode == -9
    worker = Path("/proc") / done.stdout.strip()
    for _ in range(500):
        # Without a parent that waits for it, what is left of a process may be its number alone.
        if not worker.exists() or "State:\tZ" in (worker / "status").read_text():
            return
        time.sleep(0.02)
    pytest.fail("the worker outlived its parent")
