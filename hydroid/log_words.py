"""The words of the findings of a log, by kind: statement and hint, as `hydroid.words` fills them.

A statement follows the file, line and column, and ends with no full stop. `{rows}` is empty, or counts the
rows below the first one.
"""

OUTSIDE = (
    "{quantity} of joint{s} {names} is {value:.6g} {unit}, allowed are {low:.6g} to {high:.6g} {unit}{rows}"
)
UNIT = "the file says that {names} {is} in {unit}, but log."
RANGE = "if commands are in {range}, set log.command.scale: {scale}"

LOG_WORDS: dict[str, tuple[str, str]] = {
    "unreadable": ("{what}", "{hint}"),
    "layout": ("{what}", ""),
    # its columns
    "no such joint": (
        "there is no joint {0}; the arm has joints 1 to {joints}",
        "correct outputs or log.joints",
    ),
    "no output angle": (
        "output joint {0} has no angle column",
        "map it in log.joints, or choose another output",
    ),
    "absent joints": ("holds nothing of joint{s} {names}", ""),
    "missing column": (
        "the {part} lacks {missing}",
        "the columns are: {columns}; set the right names in {settings} (`hydroid convert LOG --out LOG.csv` "
        "guesses them), or a joint that is not in the log to null: log.joints.{joint}=null",
    ),
    "column twice": ("has {count:.0f} columns of this name", "rename all but one"),
    "shared column": ("one column cannot be {names}", "correct log.joints in the config"),
    # its rows and cells
    "torn row": (
        "the row should have {cells} cells, as the header has{rows}",
        "correct or delete the line, or use --repair",
    ),
    "hole": (
        "{what}{rows}",
        "correct the cell; --repair fills up to {longest:g} s (log.repair_s) between good cells",
    ),
    "no time": (
        "{what}{rows}",
        "time is a number in log.time.unit, or a time of day (12:30:05.25), with or without date",
    ),
    "outside": (
        OUTSIDE,
        "correct the cells, or unit, scale and offset of {column} in log.{quantity}, or the joint's range",
    ),
    "slightly outside": (
        OUTSIDE,
        "it is used as it is: correct the joint's range, or log.{quantity} of {column}, if it is wrong",
    ),
    "outside in another range": (OUTSIDE, RANGE),
    "outside in another unit": (OUTSIDE, "if angles are in {other}, set log.angle.unit: {other}"),
    "outside, turned": (
        OUTSIDE,
        "if joint {0} counts the other way, set log.joints.{0}.angle.scale: {scale}",
    ),
    "jump": (
        "{0} jumps by {step:.6g} deg from one sample to the next{rows}",
        "correct the cells, or log.angle's unit and scale",
    ),
    "wrap": ("{0} wraps by 360 deg and was joined{rows}", ""),
    "repair": (
        "repaired: cells filled: {cells:.0f}, samples inserted: {samples:.0f}, rows left out: {lost:.0f}",
        "angles interpolated, commands held",
    ),
    # its time
    "time order": (
        "time does not increase: {time:.12g} s follows {before:.12g} s{rows}",
        "delete or sort the lines, or log the time with more digits",
    ),
    "too short": ("lasts {duration:.6g} s (samples: {samples:.0f}); at least 0.5 s is needed", "{remedy}"),
    "too slow": ("has a sample every {period:.6g} s, at most {slowest:g} s can be used", "{remedy}"),
    "gap": (
        "{gap:.6g} s without a sample, the usual step is {period:.6g} s{rows}",
        "--repair fills gaps up to {longest:g} s (log.repair_s); cut the log into two files at longer ones",
    ),
    "jitter": (
        "sample period varies from {least:.4g} to {most:.4g} s around {period:.4g} s{rows}",
        "commands are held and angles interpolated",
    ),
    "resampled": (
        "resampled from steps of {step:.6g} s to {period:g} s",
        "angles interpolated, commands held, or averaged where the log is faster",
    ),
    # its units
    "unit of time": (f"{UNIT}time.unit says otherwise", "set log.time.unit: {unit}"),
    "unit of angle": (f"{UNIT}angle.unit says otherwise", "set log.angle.unit: {unit}"),
    "unit of command": (
        f"{UNIT}command.scale is 1",
        "command [%] = scale · cell + offset: for ±10 V set log.command.scale: 10",
    ),
    "range": ("the command of joint{s} {names} looks like {range}", "if so, set log.command.scale: {scale}"),
    # its motion
    "undriven": ("no joint is driven", "check log.command"),
    "angle is constant": (
        "angle of joint{s} {names} never changes",
        "check the sensor and log.angle",
    ),
    "command is constant": (
        "command of joint{s} {names}, whose angle is compared, is constant",
        "such a log alone says little: fit it together with others",
    ),
    "early": (
        "command of joint{s} {names} looks {lag:.2f} s early against the angle",
        "set log.delay_s: {delay:.2f} if the machine has that transport delay",
    ),
    "late": (
        "angle of joint{s} {names} moves {lag:.2f} s before the command, as no machine does",
        "the log's clocks differ: mend the log, or set log.delay_s: {delay:.2f}",
    ),
    "turned": (
        "angle of joint {0} moves against the command (for {against:.0%} of {path:.3g} deg of travel)",
        "if the command is logged with the opposite sign, set log.joints.{0}.command.scale: -1",
    ),
    "no motion": (
        "strong commands hardly move joint{s} {names}: by {most:.2g} deg at most",
        "check log.joints (is this the angle of that command?), and if angles are in rad, "
        "set log.angle.unit: rad",
    ),
    "at a stop": (
        "joint {0} is driven against the end of its travel for {seconds:.3g} s",
        "this time says nothing about the valve; the joint's range in the arm's file should end there",
    ),
    "no rest": (
        "begins with a command{after}",
        "the first sample is the start pose: begin a log with a second of rest",
    ),
    # all logs together
    "directions differ": (
        "joint {0} moves against its command in {turned} of {logs} logs",
        "the sign of the command or the angle differs between the logs: correct it in these logs",
    ),
    "open valve curve": (
        "no command [%] of {gaps}: nothing is known about the valve curve there",
        "add logs with such commands, or keep the parameters of the curve fixed",
    ),
}
