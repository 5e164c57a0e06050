"""Work in chunks over threads: the same chunks, the same sums, whatever the number of threads."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TypeVar

from .errors import Cancelled

Result = TypeVar("Result")

_here = threading.local()

# Runs that work is cut into at least, whatever the number of threads: the same cuts, the same bits.
SHARES = 8


@dataclass
class Run:
    """What every stage of a bake is handed: threads, progress, the wish to stop, and a count of rays.

    Parameters
    ----------
    threads : worker threads.
    progress : called with (stage, fraction in [0, 1]), from any thread.
    cancelled : asked between chunks whether to stop.
    """

    threads: int = 1
    progress: Callable[[str, float], None] | None = None
    cancelled: Callable[[], bool] | None = None
    rays: dict[str, int] = field(default_factory=dict)
    stage: str = ""
    _pool: ThreadPoolExecutor | None = field(default=None, init=False, repr=False, compare=False)
    _counting: threading.Lock = field(default_factory=threading.Lock, init=False, repr=False, compare=False)

    def count(self, rays: int) -> None:
        """Add rays to the current stage; threads may do so at once."""
        with self._counting:
            self.rays[self.stage] = self.rays.get(self.stage, 0) + rays

    def check(self) -> None:
        """Raise Cancelled if the user wants to stop."""
        if self.cancelled is not None and self.cancelled():
            raise Cancelled("cancelled: nothing was changed")

    def report(self, fraction: float) -> None:
        """Tell how far the current stage is."""
        if self.progress is not None:
            self.progress(self.stage, min(1.0, fraction))

    def step(self, fraction: float) -> None:
        """Tell how far the current stage is, and end the work if the user wants to stop."""
        self.check()
        self.report(fraction)

    @contextmanager
    def beside(self, stage: str, work: Callable[[Run], Result]) -> Iterator[Callable[[], Result]]:
        """Let `work` of a Run of its own go on in a thread of its own, where there are threads to spare; what is handed
        out waits for its result. Its rays count for `stage`."""
        over = threading.Event()
        own = Run(1, None, lambda: over.is_set() or (self.cancelled is not None and self.cancelled()), stage=stage)

        def result() -> Result:
            found = future.result() if future is not None else work(own)
            self.rays[stage] = self.rays.get(stage, 0) + own.rays.get(stage, 0)
            return found

        future = None
        if self.threads == 1:
            yield result
            return
        with ThreadPoolExecutor(1) as pool:
            future = pool.submit(work, own)
            try:
                yield result
            finally:
                over.set()

    def map(self, work: Callable[..., Result], pieces: Iterable[Any]) -> list[Result]:
        """`work` of every piece, in the order of the pieces; a few pieces ahead of the workers at most. Work that maps
        work of its own does it where it is."""
        pieces = list(pieces)
        results: list[Any] = [None] * len(pieces)
        within = getattr(_here, "is_worker", False)
        if self.threads == 1 or len(pieces) == 1 or within:
            # Work within work tells nothing of how far the whole is.
            _here.is_worker = within or len(pieces) > 1
            try:
                for index, piece in enumerate(pieces):
                    self.check()
                    results[index] = work(piece)
                    if not within:
                        self.report((index + 1) / len(pieces))
            finally:
                _here.is_worker = within
            return results
        if self._pool is None:
            # Kept, for starting threads takes as long as a small piece of work. They end with the run.
            self._pool = ThreadPoolExecutor(self.threads, initializer=setattr, initargs=(_here, "is_worker", True))
        waiting: dict[Future[Result], int] = {}
        done = 0
        try:
            for index, piece in enumerate(pieces):
                self.check()
                waiting[self._pool.submit(work, piece)] = index
                if len(waiting) >= 2 * self.threads:
                    done += self._collect(waiting, results)
                    self.report(done / len(pieces))
            while waiting:
                self.check()
                done += self._collect(waiting, results)
                self.report(done / len(pieces))
        finally:
            for future in waiting:
                future.cancel()
            wait(waiting)
        return results

    @staticmethod
    def _collect(waiting: dict[Future[Any], int], results: list[Any]) -> int:
        finished, _ = wait(waiting, return_when=FIRST_COMPLETED)
        for future in finished:
            results[waiting.pop(future)] = future.result()
        return len(finished)


def shares(count: int, size: int, least: int = 1) -> list[slice]:
    """`count` things in runs of at most `size`, for threads: enough runs for all, but of at least `least` things."""
    return slices(count, min(size, max(-(-count // SHARES), least)))


def slices(count: int, size: int) -> list[slice]:
    """`count` things in runs of `size`."""
    size = max(1, size)
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]
