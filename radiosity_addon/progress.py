"""How far a bake is: written by worker threads, read by the terminal and the window."""

from __future__ import annotations

import sys
import threading
import time
from dataclasses import dataclass, field
from typing import TextIO

# Part of a bake's time that each stage usually takes; only the estimate of the time left depends on it.
STAGE_WEIGHTS = {
    "export": 2.0, "unwrap": 4.0, "prepare": 1.0, "lumels": 4.0, "patches": 8.0, "form factors": 12.0, "solve": 1.0,
    "gather": 35.0, "direct": 25.0, "audit": 10.0, "finish": 2.0, "write": 2.0,
}
# Seconds between two lines on a terminal, and on anything else (a log).
TERMINAL_STEP, LOG_STEP = 0.2, 5.0
# No guess of the time left before this part is done, or before so many seconds.
FIRST_GUESS, FIRST_SECONDS = 0.02, 1.0


@dataclass
class Progress:
    """The state of one bake. Called with (stage, fraction of the stage), from any thread."""

    stage: str = "export"
    fraction: float = 0.0
    weights: dict[str, float] = field(default_factory=STAGE_WEIGHTS.copy)
    started: float = field(default_factory=time.monotonic)
    _done: dict[str, float] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def __call__(self, stage: str, fraction: float) -> None:
        with self._lock:
            if stage != self.stage:
                self._done[self.stage] = 1.0
            self.stage = stage
            self._done[stage] = min(max(fraction, self._done.get(stage, 0.0)), 1.0)
            done = sum(self.weights.get(name, 1.0) * part for name, part in self._done.items())
            total = sum(self.weights.get(name, 1.0) for name in self.weights.keys() | self._done.keys())
            # A stage that others overtake counts as done, and the whole never goes backwards.
            self.fraction = max(self.fraction, min((done + self._skipped()) / total, 1.0))

    def _skipped(self) -> float:
        """Weight of the stages that lie before the present one and never came up."""
        if self.stage not in self.weights:
            return 0.0
        before = list(self.weights)[:list(self.weights).index(self.stage)]
        return sum(self.weights[name] for name in before if name not in self._done)

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.monotonic() - self.started

    @property
    def seconds_left(self) -> float | None:
        """A guess from the part that is done; None while there is nothing to guess from."""
        if self.fraction < FIRST_GUESS or self.elapsed < FIRST_SECONDS:
            return None
        return self.elapsed * (1 - self.fraction) / self.fraction

    def line(self) -> str:
        """Stage, per cent and time left, for people."""
        left = self.seconds_left
        return f"{self.stage}: {self.fraction:.0%}" + (f", {clock(left)} left" if left is not None else "")


def clock(seconds: float) -> str:
    """Minutes and seconds, 1:05."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"


class Terminal:
    """Shows progress on a terminal in one line that changes; in a log, a line now and then."""

    def __init__(self, progress: Progress, stream: TextIO | None = None) -> None:
        self.progress = progress
        self.stream = stream or sys.stdout
        self.is_terminal = self.stream.isatty()
        self._last = -LOG_STEP
        self._stage = ""

    def show(self) -> None:
        """Write the present state if it is time to."""
        now = time.monotonic()
        step = TERMINAL_STEP if self.is_terminal else LOG_STEP
        if now - self._last < step and (self.is_terminal or self.progress.stage == self._stage):
            return
        self._last, self._stage = now, self.progress.stage
        text = self.progress.line()
        self.stream.write(f"\r{text:<60}" if self.is_terminal else f"{text}\n")
        self.stream.flush()

    def close(self) -> None:
        """Leave the line that changes."""
        if self.is_terminal and self._stage:
            self.stream.write(f"\r{'':<60}\r")
            self.stream.flush()
