"""A small disk of its own, which a test fills."""

import subprocess
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import pytest

PAGE = 4096
"""bytes that a disk of this kind counts in"""


class Disk:
    """A file system in memory; the tests that need one are skipped where none may be
    mounted."""

    def __init__(self, path: Path, size: int) -> None:
        self.path = path
        done = _mount("-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(path))
        if done.returncode:
            pytest.skip(f"no disk can be mounted: {done.stderr.strip()}")

    def resize(self, size: int) -> None:
        """Give the disk another size [byte]."""
        assert not _mount("-o", f"remount,size={size}", str(self.path)).returncode

    def protect(self) -> None:
        """Let nobody write to the disk."""
        assert not _mount("-o", "remount,ro", str(self.path)).returncode


def _mount(*words: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(["mount", *words], capture_output=True, text=True)


@contextmanager
def disk(path: Path, size: int) -> Generator[Disk]:
    """Mount an empty disk of a size [byte] at a path."""
    path.mkdir(exist_ok=True)
    mounted = Disk(path, size)
    try:
        yield mounted
    finally:
        subprocess.run(["umount", str(path)], check=True)


def used(path: Path) -> int:
    """Return how many bytes of their disk the files below a path take."""
    sizes = [file.stat().st_size for file in path.rglob("*") if file.is_file()]
    return sum(-(-size // PAGE) * PAGE for size in sizes)
