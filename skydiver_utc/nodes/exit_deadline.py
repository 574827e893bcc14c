"""A process that has done its work ends, even where the middleware does not let it. No rclpy here.

Fast DDS 2.14 waits at its end for callbacks of discovery that run just then, and holds the mutex that they
need: a node that ends while others come or go can hang for ever, with Python's lock held. So the deadline is
kept by the C library alone, in a thread that it starts at that time.
"""

import ctypes

_CLOCK_MONOTONIC = 1
_SIGEV_THREAD = 2


class _SigEvent(ctypes.Structure):
    """struct sigevent of Linux with 64 bits."""

    _fields_ = [
        ("value", ctypes.c_void_p),
        ("signo", ctypes.c_int),
        ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("attribute", ctypes.c_void_p),
        ("padding", ctypes.c_char * 32),
    ]


class _TimerSpec(ctypes.Structure):
    """struct itimerspec: interval and time to go, each in s and ns."""

    _fields_ = [(name, ctypes.c_long) for name in ("every_s", "every_ns", "in_s", "in_ns")]


def end_in_time(code: int, seconds: int) -> None:
    """End this process with this exit code when it is still there after so many seconds.

    Nothing is flushed then. Without POSIX timers, as on macOS, nothing is done.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    if not hasattr(libc, "timer_create"):
        return
    function = ctypes.cast(libc._exit, ctypes.c_void_p)
    event = _SigEvent(value=code, notify=_SIGEV_THREAD, function=function)
    timer = ctypes.c_void_p()
    if libc.timer_create(_CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) != 0:
        raise OSError(ctypes.get_errno(), "timer_create")
    spec = _TimerSpec(in_s=seconds)
    if libc.timer_settime(timer, 0, ctypes.byref(spec), None) != 0:
        raise OSError(ctypes.get_errno(), "timer_settime")
