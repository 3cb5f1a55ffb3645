"""Are the speeds that a fit states those of the log? The shoulder's, beside slopes of the virtual rig's logs.

    python benchmarks/rig_speeds.py RUN

RUN is a fit of stage 2 to examples/logs/rig_shoulder_1.csv. Wherever a log holds a command while the joint
passes the middle of its travel, a straight line through WINDOW seconds of angles around that moment gives the
speed that the rig really had. Log 1 was fitted, log 2 was not. A speed counts as inside where the difference
is within the root of the summed squares of both 95 % half intervals. The slope's error is that of white noise
about its line.
"""

import argparse
from pathlib import Path

import numpy as np

from hydroid import load_identified, read_logs

ROOT = Path(__file__).parents[1]
WINDOW, BEFORE = 0.4, 0.6
"""length of the straight line, and how long the command must have been held before its middle [s]"""


def slopes(
    time: np.ndarray, angle: np.ndarray, command: np.ndarray, middle: float
) -> list[tuple[float, ...]]:
    """Command [%], speed and its standard deviation [deg/s] wherever the angle [deg] passes the middle."""
    found = []
    passes = np.flatnonzero(np.diff(np.sign(angle - middle)) != 0)
    half, before = round(WINDOW / 2 / 0.01), round(BEFORE / 0.01)
    last = -np.inf
    for k in passes:
        part = slice(k - before, k + half)
        if (
            k - before < 0
            or k + half > len(time)
            or np.ptp(command[part])
            or command[k] == 0
            or k - last < half
        ):
            continue
        last = k
        at, q = time[k - half : k + half] - time[k], angle[k - half : k + half]
        line, covariance = np.polyfit(at, q, 1, cov=True)
        found.append((float(command[k]), float(line[0]), float(np.sqrt(covariance[0, 0]))))
    return found


def main() -> None:
    """Print a row for every slope, and how many lie inside."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("run", type=Path)
    model = load_identified(parser.parse_args().run)
    assert model.summary is not None
    curve = model.summary.curves["joint2_speed"]
    low, high = np.array(curve.interval, float).T
    for number in (1, 2):
        (log,) = read_logs(ROOT / "examples" / "logs" / f"rig_shoulder_{number}.csv", model.settings)
        angle = np.degrees(log.angle[:, 1])
        middle = round((angle.min() + angle.max()) / 2)
        rows = sorted(slopes(log.time, angle, log.command[:, 1], middle))
        inside = 0
        print(f"\nlog {number}: passing {middle} deg\n")
        print("| command [%] | rig [deg/s] | fit [deg/s] | 95 % | inside |")
        print("| ---: | ---: | ---: | --- | --- |")
        for command, speed, sd in rows:
            value, first, last = (np.interp(command, curve.at, ends) for ends in (curve.value, low, high))
            meets = abs(speed - value) <= np.hypot((last - first) / 2, 1.96 * sd)
            inside += meets
            rig, ends = f"{speed:.2f} ± {1.96 * sd:.2f}", f"{first:.2f} to {last:.2f}"
            print(f"| {command:.1f} | {rig} | {value:.2f} | {ends} | {'yes' if meets else 'no'} |")
        print(f"\n{inside} of {len(rows)} inside")


if __name__ == "__main__":
    main()
