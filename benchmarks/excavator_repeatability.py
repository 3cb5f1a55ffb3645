"""How well the excavator repeats itself: 1 s of a log beside the most similar second of another fit_* log.

    python benchmarks/excavator_repeatability.py [RUN]        (default: runs/excavator/fit)

Similar are seconds with nearly the same commands, of all joints and of the second before, and nearly the
same angles. Where commands and angles differ a little, the model of RUN says what that changes, which is
taken off. Half of the mean square of what is left is the variance in one second that commands and angles do
not explain. Summed along each log it becomes an error of the angle. No two seconds are quite alike, so this
is more than what a perfect model would leave; the closest fifth of the pairs shows how much more.

Prints by joint: the spread [deg] in the closest fifth of the pairs and in all; the share of it in the
mean square error that the model makes in these seconds; and the mean absolute error of whole logs [deg]
to which the spreads of all pairs add up, with its standard error over the logs.
"""

import sys

import numpy as np
from excavator import FOLDER, JOINTS

import hydroid
from hydroid.identified_model import load_identified
from hydroid.prediction import predict

SECOND = 20
"""samples"""
EVERY = 2
"""samples between the seconds that are compared with those of other logs"""
OWN, OTHER, ANGLES = 8.0, 25.0, np.array([42.0, 7.0, 7.0, 14.0])
"""differences that count the same: of the joint's command and of others' [%], and of the angles [deg]"""


Signals = tuple[np.ndarray, np.ndarray, np.ndarray]
"""of a log: commands [%], angles and predicted angles [deg], each of shape (T, joints)"""


def described(command: np.ndarray, angle: np.ndarray, joint: int, k: int) -> np.ndarray:
    """What acts on a joint in the second from sample k, in the scales above."""
    others = [i for i in range(command.shape[1]) if i != joint]
    own = command[k - SECOND : k + SECOND : 4, joint] / OWN
    other = command[k - SECOND // 2 : k + SECOND : 6][:, others].ravel() / OTHER
    return np.concatenate([own, other, angle[k, : len(ANGLES)] / ANGLES])


def pairs(logs: list[Signals], joint: int) -> np.ndarray:
    """Rows of log, distance, model's error and difference of errors [deg / s], second after second."""
    places = [(i, k) for i, (_, q, _) in enumerate(logs) for k in range(SECOND, len(q) - SECOND, EVERY)]
    features = np.array([described(logs[i][0], logs[i][1], joint, k) for i, k in places])
    errors = [q[:, joint] - p[:, joint] for _, q, p in logs]
    gained = np.array([errors[i][k + SECOND] - errors[i][k] for i, k in places])
    of_log = np.array([i for i, _ in places])
    rows: list[tuple[float, ...]] = []
    for n, (i, k) in enumerate(places):
        if k % SECOND == 0:
            distance = np.sqrt(np.mean((features - features[n]) ** 2, axis=1))
            distance[of_log == i] = np.inf
            near = int(distance.argmin())
            rows.append((i, distance[near], gained[n], (gained[n] - gained[near]) / np.sqrt(2)))
    return np.array(rows)


def main(run: str) -> None:
    """Print one line per joint."""
    model = load_identified(run)
    numbers = tuple(sorted(JOINTS))
    logs: list[Signals] = []
    for log in hydroid.read_logs(sorted(FOLDER.glob("fit_*.csv")), model.settings):
        predicted = np.rad2deg(predict(model, log, numbers))
        logs.append((log.command[:, : len(numbers)], np.rad2deg(log.angle), predicted))
    print(f"{'':8}{'closest fifth':>15}{'all pairs':>11}{'share':>8}{'whole logs':>12}")
    for joint, name in JOINTS.items():
        found = pairs(logs, joint - 1)
        rms = np.sqrt(np.mean(found[:, 2:] ** 2, axis=0))
        closest = found[found[:, 1].argsort()[: len(found) // 5], 3]
        walks = [np.abs(np.cumsum(found[found[:, 0] == i, 3])).mean() for i in range(len(logs))]
        spread, summed = np.sqrt(np.mean(closest**2)), np.std(walks, ddof=1) / np.sqrt(len(walks))
        share = f"{100 * (rms[1] / rms[0]) ** 2:.0f} %"
        print(f"{name:8}{spread:15.2f}{rms[1]:11.2f}{share:>8}{np.mean(walks):7.1f} ± {summed:.1f}")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "runs/excavator/fit")
