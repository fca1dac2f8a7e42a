"""Tasks for a worker process: quick, refused, broken, deadly and long; and those of the page, made to wait."""

import os
import time
from functools import partial
from unittest import mock

import underlay as ul
from underlay.app import results as posterior
from underlay.app.tasks import Analyst

# Steps of a sampler after which there is a posterior.
ENOUGH = 20


class Tasks:
    def __init__(self, word):
        self.word = word

    def say(self, more, tell):
        tell(f"{self.word} ...")
        return f"{self.word} {more}"

    def refuse(self, _tell):
        raise ul.InputError("depth must be positive")

    def break_down(self, _tell):
        raise ZeroDivisionError("division by zero")

    def die(self, _tell):
        os._exit(3)

    def go_on(self, tell):
        for step in range(10_000):
            tell(step)
            time.sleep(0.01)
        return "the end"

    def sleep(self, _tell):
        time.sleep(600)


class Waiting(Analyst):
    """The tasks of the page; a sampler that has done enough waits there until it is told to stop.

    It makes a chain, also where weighted draws would do: there is nothing to stop in those.
    """

    def sample(self, most, tell):
        def wait_there(value):
            tell(value)
            while value.done >= ENOUGH:
                time.sleep(0.02)
                tell(value)

        with mock.patch.object(posterior, "sample", partial(posterior.sample, method="emcee")):
            return super().sample(most, wait_there)


class Held(Analyst):
    """The tasks of the page; a fit that is through tells so by a file, and says nothing until another is there."""

    def fit(self, tell):
        def hold(value):
            (self._folder.results / "fitted").touch()
            while not (self._folder.results / "go").exists():
                time.sleep(0.02)
            tell(value)

        return super().fit(hold)
