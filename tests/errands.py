"""Work for processes of their own: functions that such a process can import by name."""

import os
import signal
import time

import numpy as np

from planish.errors import InputError


def add(a, b, tell):
    tell("adding", 0.5)
    return a + b


def where(tell):
    return os.getpid(), os.getpgrp()


def refuse(tell):
    raise InputError("scan.obj is no scan")


def fail(tell):
    raise ZeroDivisionError("by nothing")


def sleep(seconds, tell):
    tell("sleeping", 0.0)
    time.sleep(seconds)


def fill(megabytes, tell):
    return float(np.ones(megabytes * 125_000).sum())  # 8 bytes each


def die(tell):
    os.kill(os.getpid(), signal.SIGKILL)
