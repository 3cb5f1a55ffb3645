"""What hydroid's loggers say, on the terminal."""

import logging
from collections.abc import Generator
from contextlib import contextmanager

import typer


@contextmanager
def shown(verbose: bool, quiet: bool) -> Generator[None]:
    """Show warnings, or nothing where quiet; every line of the run's log where verbose.

    An error is not among them: it ends the command, which says it.
    """
    from hydroid.run.run_log import LINE

    handler = _Terminal()
    handler.setFormatter(LINE if verbose else logging.Formatter("hydroid: %(message)s"))
    handler.addFilter(lambda record: verbose or (record.levelno == logging.WARNING and not quiet))
    logger = logging.getLogger("hydroid")
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)


class _Terminal(logging.Handler):
    """Writes to what is stderr at that moment: a progress bar takes its place while it is drawn."""

    def emit(self, record: logging.LogRecord) -> None:
        typer.echo(self.format(record), err=True)
