"""With which code a run was made."""

import subprocess
from importlib.metadata import version

from hydroid.assets import assets


def code_version() -> str:
    """Return hydroid's version; with the commit where it runs from a checkout that has one."""
    own, folder = version("hydroid"), assets()
    if not (folder / ".git").exists():
        return own
    try:
        command = ["git", "-C", str(folder), "describe", "--always", "--dirty=, changed"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return own
    return f"{own} ({done.stdout.strip()})"
