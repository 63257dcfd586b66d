"""Parse untrusted files outside the event loop, which also serves the link to the drone.

A separate process reads files and long requests, one after the other, at a lower priority. If
it exceeds the CPU or memory limits of `uavrt.core.foreign`, the kernel ends it. The request
then fails with an error, and the next one gets a new process. Requests and results are frames
on its pipes: eight bytes of length, then a pickle.
"""

import asyncio
import contextlib
import os
import pickle
import signal
import struct
import subprocess
import sys
import threading
import traceback
import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, BinaryIO, TypeVar

from uavrt.core.errors import CommandRefused, FormatError, UavrtError
from uavrt.core.foreign import CPU_S, MEMORY_BYTES

T = TypeVar("T")
MOST_WAITING = 64
"""Maximum number of calls queued for the process that reads untrusted files; moving the page's
map sends twenty."""
WALL_S = 60.0
"""Longest time for one call in the file-reading process [s]; enough for a busy computer."""
_NICE = 10
_LENGTH = struct.Struct(">Q")
_REMEDY = "Choose a smaller file, or simplify this one"
_TOO_LONG = f"the calculation takes longer than {CPU_S} s"
_EXIT_LARGE = 70
_ENDS = {
    -getattr(signal, "SIGXCPU", 24): _TOO_LONG,
    _EXIT_LARGE: f"the calculation needs more than {MEMORY_BYTES // 10**6} MB of memory",
}


class ForeignWorker:
    """Calls functions in another process, with limits on time and memory.

    Functions must be on module level, and their arguments and results must be picklable.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()
        self._waiting = 0
        self._threads = ThreadPoolExecutor(1, thread_name_prefix="foreign")
        self._end: Callable[[], object] = _nothing

    async def call(self, function: Callable[..., T], *arguments: Any) -> T:
        """Call a function in the other process; if cancelled, the process is ended. Raises
        `UavrtError`.
        """
        if self._waiting >= MOST_WAITING:
            raise CommandRefused(
                f"{self._waiting} other files are still waiting to be read",
                remedy="Try again in a minute",
            )
        self._waiting += 1
        try:
            answer = self._threads.submit(self.result, function, *arguments)
            try:
                return await asyncio.wrap_future(answer)
            except asyncio.CancelledError:
                while not answer.done():  # the program's end would wait for it
                    self.close()
                    await asyncio.sleep(0.01)
                raise
        finally:
            self._waiting -= 1

    def result(self, function: Callable[..., T], *arguments: Any) -> T:
        """Call a function in the process, and wait for its result; raises `UavrtError`."""
        question = pickle.dumps((function, arguments), pickle.HIGHEST_PROTOCOL)
        with self._lock:
            process = self._running()
            try:
                done, value = _asked(process, question)
            except TimeoutError:
                self.close()
                raise FormatError(_TOO_LONG, remedy=_REMEDY) from None
            except (EOFError, OSError):
                code = process.wait()
                self.close()
                text = _ENDS.get(code, "the process that reads the file has ended")
                raise FormatError(text, remedy=_REMEDY) from None
        if done:
            return value  # type: ignore[no-any-return]
        kind, message, remedy = value
        raise kind(message, remedy=remedy)

    def close(self) -> None:
        """End the process; the next call starts another."""
        self._end()

    def _running(self) -> "subprocess.Popen[bytes]":
        if self._process is None or self._process.poll() is not None:
            self.close()
            self._process = process = subprocess.Popen(
                [sys.executable, "-P", "-m", __name__],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
                bufsize=0,
                process_group=0,
            )
            self._end = weakref.finalize(self, _end, process)
        return self._process


def _nothing() -> None:
    """Do nothing; called in place of ending the file-reading process while none runs."""


def _end(process: "subprocess.Popen[bytes]") -> None:
    process.kill()
    process.wait()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()


def _asked(process: "subprocess.Popen[bytes]", question: bytes) -> tuple[bool, Any]:
    assert process.stdin is not None
    assert process.stdout is not None
    expired = threading.Event()

    def end() -> None:
        expired.set()
        process.kill()

    timer = threading.Timer(WALL_S, end)
    timer.daemon = True
    timer.start()
    try:
        _write_frame(process.stdin, question)
        found: tuple[bool, Any] = pickle.loads(_read_frame(process.stdout))
    except (EOFError, OSError):
        if expired.is_set():
            raise TimeoutError from None
        raise
    finally:
        timer.cancel()
    return found


def _write_frame(pipe: BinaryIO | Any, content: bytes) -> None:
    view = memoryview(_LENGTH.pack(len(content)) + content)
    while view:
        view = view[pipe.write(view) :]


def _read_frame(pipe: BinaryIO | Any) -> bytes:
    (length,) = _LENGTH.unpack(_exactly(pipe, _LENGTH.size))
    return _exactly(pipe, length)


def _exactly(pipe: BinaryIO | Any, size: int) -> bytes:
    content = bytearray()
    while len(content) < size:
        piece = pipe.read(min(size - len(content), 1 << 20))
        if not piece:
            raise EOFError
        content += piece
    return bytes(content)


# ------------------------------------------------------------------- in the process


def main() -> None:
    """Answer the requests on the pipe one after the other until the pipe is closed."""
    if hasattr(os, "nice"):
        os.nice(_NICE)
    questions = os.fdopen(os.dup(0), "rb", buffering=0)
    answers = os.fdopen(os.dup(1), "wb", buffering=0)
    with open(os.devnull, "r+b") as nothing:  # libraries print
        os.dup2(nothing.fileno(), 0)
        os.dup2(nothing.fileno(), 1)
    while True:
        try:
            question = _read_frame(questions)
        except EOFError:
            return
        try:
            # Unpickling imports the function's module; that counts for no file.
            function, arguments = pickle.loads(question)
            _limit()
            answer = (True, function(*arguments))
        except UavrtError as error:
            answer = (False, (_plain(error), error.message, error.remedy))
        except MemoryError:
            os._exit(_EXIT_LARGE)
        except Exception as error:  # noqa: BLE001 - a fault of ours, for the log
            traceback.print_exc()
            text = f"the file cannot be read: {type(error).__name__}"
            answer = (False, (FormatError, text, "Report this error, and attach the file"))
        content = pickle.dumps(answer, pickle.HIGHEST_PROTOCOL)
        _write_frame(answers, content)
        del question, answer, content


def _plain(error: UavrtError) -> type[UavrtError]:
    """Copy an error to one with only a message and a remedy, which can be pickled."""
    made_by = "__init__"
    for kind in type(error).__mro__:
        if getattr(kind, made_by) is getattr(UavrtError, made_by):
            return kind
    return UavrtError


def _limit() -> None:
    """Limit this process's CPU time and memory by the kernel; on Windows, and for memory on
    macOS, there are no such limits, and only `WALL_S` ends the process.
    """
    try:
        import resource
    except ImportError:
        return
    used = resource.getrusage(resource.RUSAGE_SELF)
    spent_s = used.ru_utime + used.ru_stime
    resource.setrlimit(resource.RLIMIT_CPU, (int(spent_s) + CPU_S + 1, resource.RLIM_INFINITY))
    if not os.path.exists("/proc/self/statm"):
        return
    with open("/proc/self/statm", encoding="ascii") as file:
        data_bytes = int(file.read().split()[5]) * resource.getpagesize()
    most = data_bytes + MEMORY_BYTES
    resource.setrlimit(resource.RLIMIT_DATA, (most, resource.RLIM_INFINITY))


if __name__ == "__main__":
    main()
