"""Functions for subprocesses, which import them by name."""

import os
import signal
import time

import numpy as np

from planish.errors import InputError


def add(a, b, progress):
    progress("adding", 0.5)
    return a + b


def where(progress):
    return os.getpid(), os.getpgrp()


def refuse(progress):
    raise InputError("scan.obj is no scan")


def fail(progress):
    raise ZeroDivisionError("by nothing")


def sleep(seconds, progress):
    progress("sleeping", 0.0)
    time.sleep(seconds)


def fill(megabytes, progress):
    return float(np.ones(megabytes * 125_000).sum())  # 8 bytes each


def die(progress):
    os.kill(os.getpid(), signal.SIGKILL)
