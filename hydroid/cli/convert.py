"""`hydroid convert`."""

from pathlib import Path
from typing import Annotated

import typer

from hydroid.cli.look import plain_finding
from hydroid.cli.options import Output, Repair, Set, overrides
from hydroid.cli.output import show


def convert(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="CSV, .mat, Parquet, ROS bag or MCAP.")],
    output: Output,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="OUT.csv", help="The CSV to write.")],
    config: Annotated[
        str | None,
        typer.Option(
            help="Settings that map the columns (`log`): a YAML file, or the name of a shipped config "
            "[default: the columns are guessed, and each guess is printed; --set corrects them]."
        ),
    ] = None,
    setting: Set = None,
    repair: Repair = False,
) -> None:
    """Write a log of any format as the CSV that every command reads: time [s], commands [%], angles [deg].

    With --config the CSV holds the data as a fit uses them: resampled to log.period_s, commands delayed by
    log.delay_s, signs and units applied.
    """
    import yaml

    from hydroid.api.convert import convert
    from hydroid.api.look import load_settings

    changes = overrides(setting)
    settings = load_settings(config, changes) if config else None
    result = convert(log, out, settings, changes=None if config else changes, repair=repair)
    guessed = [*result.guess.reasons] if result.guess else []
    left = [f"not used: {', '.join(result.guess.unused)}"] if result.guess and result.guess.unused else []
    notes = [f"{finding.level}: {finding}" for finding in result.findings]
    if result.guess:
        section = yaml.safe_dump(
            result.guess.log, default_flow_style=True, width=1e9, sort_keys=False, allow_unicode=True
        )
        left.append(f"as settings: log: {section.strip()}")
    summary = f"{out}: {len(result.log.time)} samples, {result.log.duration:.2f} s"
    plain = {
        "out": str(out),
        "samples": len(result.log.time),
        "duration_s": result.log.duration,
        "period_s": result.log.period,
        "log": result.guess and result.guess.log,
        "reasons": guessed,
        "findings": [*map(plain_finding, result.findings)],
    }
    show(output, lambda: plain, [*guessed, *left, *notes, f"{summary}, every {result.log.period:g} s"])
