"""Files: written so that they appear completely or not at all, and those that hydroid
ships."""

import csv
import errno
import io
import os
import signal
import threading
from collections.abc import Generator, Iterable, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex
from typing import Any, Literal

from hydroid.errors import RunError, SettingsError

Plain = dict[str, Any]  # a mapping as YAML and JSON hold it
PART = ".part"  # suffix of a file that is being written
NOTICES = tuple(
    getattr(signal, n) for n in ("SIGTERM", "SIGUSR1", "SIGHUP") if hasattr(signal, n)
)
"""signals by which a cluster says that time is nearly up, and a terminal that it is
closed"""


@contextmanager
def undisturbed() -> Generator[Sequence[int]]:
    """Delay Ctrl-C and the signals of a cluster until a file is written, or until
    threads have ended; yield the signals that have come.

    A KeyboardInterrupt may come between any two bytecodes, and some libraries turn it
    into another error. Where Python begins a thread or waits for one, it may leave a
    lock locked: then the process never ends.
    """
    held: list[int] = []
    # signals only interrupt the main thread
    if threading.current_thread() is not threading.main_thread():
        yield held
        return
    ours = [
        number
        for number in (signal.SIGINT, *NOTICES)
        if signal.getsignal(number) not in (None, signal.SIG_IGN)
    ]
    before = {
        number: signal.signal(number, lambda number, _: held.append(number))
        for number in ours
    }
    try:
        yield held
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for number in held[:1]:
            signal.raise_signal(number)


@contextmanager
def writing(where: Path) -> Generator[None]:
    """Turn what keeps a file or folder from being written into a RunError about it."""
    try:
        yield
    except OSError as error:
        raise RunError(f"cannot be written ({error.strerror})", where) from None


@undisturbed()
def write_atomic(path: Path, content: str | bytes, *, keep: Path | None = None) -> None:
    """Write a file so that readers see either the old content or the new, also after a
    crash.

    The content, text as UTF-8, reaches the disk before the file gets its name, so a
    power cut leaves the old file or the new one. A killed process may leave a hidden
    file with the suffix PART. `keep` is a path in the same folder to which the old
    file, if any, is moved first: after a crash between the two renamings only it
    exists. Raises RunError: the folder cannot be written, the disk is full, or the path
    is that of a folder, a pipe or a device, which a file would replace.
    """
    # a link stays, and what it leads to is written
    place = Path(os.path.realpath(path))
    if os.path.exists(path) and not is_file(path):
        raise RunError("cannot be written (it is no file)", path, "name another file")
    temporary = place.parent / f".{place.name}.{token_hex(4)}{PART}"
    try:
        with writing(path):
            place.parent.mkdir(parents=True, exist_ok=True)
            with temporary.open("xb") as file:
                file.write(content.encode() if isinstance(content, str) else content)
                file.flush()
                os.fsync(file.fileno())
            if keep is not None and place.exists():
                place.replace(keep)
            temporary.replace(place)
    finally:
        with suppress(OSError):  # it has its name by now, or was never made
            temporary.unlink()


is_file = os.path.isfile  # Path's own raises for a name that no file can have


def read_file(path: Path, most: int | None = None) -> bytes:
    """Return the bytes of a file, of a longer one the first `most`.

    Raises OSError: it cannot be read, or is a pipe or a device, which may never end.
    """
    if os.path.exists(path) and not (is_file(path) or path.is_dir()):
        raise OSError(errno.EINVAL, "it is no file", str(path))
    with path.open("rb") as file:
        return file.read(-1 if most is None else most)


def csv_text(rows: Iterable[Iterable[Any]]) -> str:
    """Return rows as CSV, with every bit of their numbers."""
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows(rows)
    return buffer.getvalue()


def yaml_text(values: Any, **style: Any) -> str:
    """Return plain values as YAML, mappings in their order; `style` is that of PyYAML's
    `dump`."""
    import yaml

    return yaml.safe_dump(values, sort_keys=False, allow_unicode=True, **style)


def fill_template(path: str, /, **values: Any) -> str:
    """Return the text of a template in the package with values in it."""
    from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

    environment = Environment(
        loader=PackageLoader("hydroid", ""),
        autoescape=select_autoescape(["html.j2"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template(path).render(values)


_PACKAGE = Path(__file__).parent


def read_table(path: str) -> Plain:
    """Return a table of the package, rows by name, from a YAML file in it."""
    import yaml

    with (_PACKAGE / path).open("rb") as rows:
        # libyaml, where it is there, takes a tenth of the time
        return yaml.load(rows, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))


def assets() -> Path:
    """Return the folder that holds `models/`, `meshes/` and `configs/`."""
    inside = _PACKAGE / "assets"
    return inside if inside.is_dir() else _PACKAGE.parent


def find_config(
    name: str | Path,
    beside: Path | None = None,
    *,
    kind: Literal["config", "arm"] = "config",
) -> Path:
    """Find a config file by a path, or the name of a shipped config with or without
    `.yaml`.

    A relative path is looked up in `beside` first; `kind`, a fit's config or an arm's
    file, decides which names the error lists.
    """
    shipped = assets() / "configs"
    for folder in (beside or Path(), Path(), shipped):
        for candidate in (folder / name, folder / f"{name}.yaml"):
            if is_file(candidate):
                return candidate
    if len(Path(name).parts) > 1:
        raise SettingsError("no such file or folder", name)
    known = sorted(
        p.stem
        for p in shipped.glob("*.yaml")
        if (p.stem == "hydrolek") == (kind == "arm")
    )
    raise SettingsError(
        f"no such {kind}", name, f"give a YAML file or one of: {', '.join(known)}"
    )
