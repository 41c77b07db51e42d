"""Engines that break: the exact engine, except that on a floor it crashes, hangs, leaks, prints or leaves."""

import ctypes
import os
import sys
import time

import numpy as np

from dropspin.comparisons.running.process_limits import ResourceLimits
from dropspin.scenarios import load
from support.engines import Exact

BALL = load("drop-ball")
SPIN = load("fall-spin")
TIGHT = ResourceLimits(processor_time=1.0, memory=300 * 2**20)


def segfault():
    ctypes.string_at(0)


def loop():
    while True:
        pass


def sleep():
    time.sleep(1000.0)


def allocate():
    hoard = []
    while True:
        hoard.append(np.ones(2**20))


def reserve():
    """64 GiB of addresses that can be neither read nor written."""
    map_ = ctypes.CDLL(None, use_errno=True).mmap
    map_.restype, map_.argtypes = ctypes.c_void_p, [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long]
    private_anonymous, protected = 0x22, 0
    if map_(None, 2**36, protected, private_anonymous, -1, 0) == ctypes.c_void_p(-1).value:
        raise MemoryError


def leave():
    os._exit(7)


def leave_well():
    os._exit(0)


def shout():
    for stream in (1, 2):
        os.write(stream, b"garbage")
    sys.stdout.write("garbage")


def fail():
    raise RuntimeError("no")


def interrupt():
    raise KeyboardInterrupt


def breaking(what):
    """The exact engine, except that it calls a function before it prepares a scene with a floor."""

    class Breaking(Exact):
        name = "breaking"

        def prepare(self, scene, dt):
            if scene.floor is not None:
                what()
            return super().prepare(scene, dt)

    return Breaking()
