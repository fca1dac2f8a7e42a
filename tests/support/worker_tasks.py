"""Tasks for a worker process: quick, refused, broken, deadly and long."""

import os
import time

from underlay.errors import InputError


class Tasks:
    def __init__(self, word):
        self.word = word

    def say(self, more, tell):
        tell(f"{self.word} ...")
        return f"{self.word} {more}"

    def refuse(self, _tell):
        raise InputError("depth must be positive")

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
