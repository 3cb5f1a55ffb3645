"""What to do after `hydroid init`: the commands with their files, and a page that says so."""

import shlex
from collections.abc import Sequence
from pathlib import Path

PAGE = """\
# {name}

Look first: `arm.png` shows the arm, its axes and its cylinders. Compare the directions of positive angles
with your log.

Then, from the folder in which you ran `hydroid init`:

```sh
{commands}
```

- `arm.xml` is the arm's model, `arm.yaml` has its actuators: correct both.
- `fit.yaml` are the settings of the fit: columns of the log, parameters, starts, priors.
- A log should begin with a second without a command. Record several: fit on some, validate on another.
"""


def next_steps(folder: Path, logs: Sequence[Path]) -> tuple[str, ...]:
    """Return the commands to run; of several logs the last is kept to validate on."""
    names = [shlex.quote(str(log)) for log in logs] or ["LOG.csv", "OTHER.csv"]
    fitted, other = " ".join(names[:-1] or names), names[-1]
    home = shlex.quote(str(folder))
    config, run = f"--config {home}/fit.yaml", f"{home}/runs/fit"
    return (
        f"hydroid check {' '.join(names)} {config}",
        f"hydroid fit-hyd {fitted} {config} --out {run}",
        f"hydroid validate {other} --fit {run} --out {home}/runs/validation",
        f"hydroid suggest {fitted} --fit {run} --out {home}/runs/suggestions",
    )


def steps_page(
    name: str, folder: Path, commands: Sequence[str], notes: Sequence[str], reasons: Sequence[str]
) -> str:
    """Return the page as Markdown, with what was assumed of the arm and of the log's columns."""
    page = PAGE.format(name=name, folder=folder, commands="\n".join(commands))
    for heading, lines in (("What was assumed of the arm", notes), ("The log's columns", reasons)):
        if lines:
            page += f"\n## {heading}\n\n" + "".join(f"- {line}\n" for line in lines)
    return page
