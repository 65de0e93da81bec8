"""Where the package meets people and the workflow: exit codes, logs, threads."""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from spa_fo.errors import BadInput

EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130


@contextmanager
def bad_input_exits() -> Iterator[None]:
    """Turn `BadInput` into its one line on stderr and exit code 2; so with unusable files."""
    try:
        yield
    except BadInput as error:
        print(f"spa-fo: {error}", file=sys.stderr)
        raise SystemExit(EXIT_BAD_INPUT) from None
    except BrokenPipeError:
        raise
    except OSError as error:
        if error.filename is None:
            raise
        print(f"spa-fo: {error.filename}: {error.strerror}", file=sys.stderr)
        raise SystemExit(EXIT_BAD_INPUT) from None


@contextmanager
def interrupt_exits() -> Iterator[None]:
    """Turn Ctrl-C into one line on stderr and exit code 130.

    Whoever is at work puts away what was half written on the way here; a second Ctrl-C does not
    cut that short. Where somebody else answers signals, that is left to them.
    """
    answers = (
        threading.current_thread() is threading.main_thread()
        and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    )
    if answers:
        signal.signal(signal.SIGINT, _interrupt_once)
    try:
        yield
    except KeyboardInterrupt:
        # CPython ends with the signal, not with our code, where one passed through an exec (a
        # dataclass being made); the next exec makes it forget.
        exec("")
        print("spa-fo: stopped; nothing half-written is left", file=sys.stderr)
        raise SystemExit(EXIT_INTERRUPTED) from None
    finally:
        if answers:
            signal.signal(signal.SIGINT, signal.default_int_handler)


def _interrupt_once(number: int, frame: FrameType | None) -> None:
    signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt


@contextmanager
def closed_pipe_is_no_error() -> Iterator[None]:
    """Leave quietly when whoever reads the output has seen enough (``spa-fo parse ... | head``)."""
    try:
        yield
        sys.stdout.flush()
    except BrokenPipeError:
        # Python flushes once more at exit: give it somewhere to write.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def workflow_step(log: Path | str, threads: int) -> Iterator[None]:
    """Run one step of the workflow: log to a file, keep to `threads`, say bad input in one line.

    Parameters
    ----------
    log : Path or str
        Gets warnings and the traceback of whatever goes wrong.
    threads : int
        Numba's number of threads; Snakemake sets those of OpenMP and MKL only.
    """
    _limit_threads(threads)
    logging.basicConfig(
        filename=log, filemode="w", encoding="utf-8", format="%(levelname)s %(name)s: %(message)s"
    )
    logging.captureWarnings(True)
    with bad_input_exits():
        try:
            yield
        except Exception:
            logging.error(traceback.format_exc())
            raise


def keep_blas_to_one_thread() -> None:
    """Tell the linear algebra to use one thread; only where NumPy is not imported yet.

    Sums split among threads round otherwise: the same seed would not always give the same bytes.
    The matrices here are too small to gain by more.
    """
    for library in ("OPENBLAS", "MKL", "BLIS"):
        os.environ[f"{library}_NUM_THREADS"] = "1"
    os.environ["VECLIB_MAXIMUM_THREADS"] = "1"


def _limit_threads(threads: int) -> None:
    import numba

    numba.set_num_threads(min(threads, numba.get_num_threads()))
