"""Progress bars on the terminal, one per stage; none if standard error is not a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import TYPE_CHECKING

import click

from recipe_cli.console import fail, safe, show_cursor

if TYPE_CHECKING:
    from click._termui_impl import ProgressBar


class Progress:
    """Call it with (stage, done, total); it draws a bar a stage and closes each when it is full."""

    def __init__(self, quiet: bool = False) -> None:
        self._shown = not quiet and sys.stderr.isatty()
        self._stage = ""
        self._bar: ProgressBar[int] | None = None
        self._done = 0

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Show that a stage has done `done` of `total`."""
        if not self._shown:
            return
        if stage != self._stage:
            self._close()
            self._stage, self._done = stage, 0
            label = f"{safe(stage):<9}"
            self._bar = click.progressbar(length=max(total, 1), label=label, file=sys.stderr, show_pos=True, width=0)
            self._bar.__enter__()
        assert self._bar is not None
        self._bar.length = max(total, 1)
        self._bar.update(done - self._done)
        self._done = done

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._close(interrupted=kind is not None and issubclass(kind, KeyboardInterrupt))

    def _close(self, interrupted: bool = False) -> None:
        if self._bar is not None and interrupted:  # the command line ends the line itself, where Ctrl-C shows
            show_cursor()
        elif self._bar is not None:
            self._bar.__exit__(None, None, None)
        self._bar = None


@contextmanager
def interruptible(described: Callable[[], tuple[str, str]]) -> Iterator[None]:
    """End the command with exit code 130 after an interrupt inside the block; `described` returns error and remedy."""
    try:
        yield
    except KeyboardInterrupt:
        from recipe_compiler.ir.errors import Code, Problem

        what, remedy = described()
        fail([Problem(what, help=remedy, code=Code.INTERRUPTED)])
        raise click.exceptions.Exit(130) from None
