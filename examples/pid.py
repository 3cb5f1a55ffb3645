"""Feed-forward with a PID controller beside it: `python examples/pid.py [RUN]`, of a
fit or the shipped arm.

The first joint that takes commands goes along a smooth path. The controller asks for
speeds: that of the path, which comes earlier by what the joint is late, and more where
the angle errs. `Plant.commands` turns them into commands. Its gains are tuned on the
plant, and tried on machines that the logs do not rule out.
"""

import sys

import numpy as np

import hydroid
from hydroid.plant import Plant, load_plant
from hydroid.use.follow import joint_lags

START, TARGET = 0.5, 0.75  # of the joint's travel
SECONDS, FASTEST = 10.0, 0.6  # of the run; part of its top speed that the path asks for
GAINS = (0.1, 0.2, 0.4, 0.8)  # speed per error, times what the joint is late
DRAWS = 5


class Path:
    """The way of one joint from `start` to `end`, with a peak of its speed at most."""

    def __init__(self, start: float, end: float, peak: float) -> None:
        self.start, self.way = start, end - start
        self.seconds = max(1.875 * abs(self.way) / peak, 1.0)

    def angle(self, time: float) -> float:
        """Return where it should be."""
        part = float(np.clip(time / self.seconds, 0.0, 1.0))
        return self.start + self.way * part**3 * (10.0 - 15.0 * part + 6.0 * part**2)

    def speed(self, time: float) -> float:
        """Return how fast it should move."""
        part = float(np.clip(time / self.seconds, 0.0, 1.0))
        return self.way / self.seconds * 30.0 * (part * (1.0 - part)) ** 2


def follow(
    machine: Plant, model: Plant, path: Path, gain: float
) -> tuple[float, float]:
    """Return the rms error along a path, and the angle at its end; gain [1/s]."""
    joint = model.joints[0] - 1
    lag = float(joint_lags(model)[joint])
    pose = model.angle
    pose[joint] = path.start
    angle = machine.reset(pose)
    integral, before, errors = 0.0, 0.0, list[float]()
    while machine.time < SECONDS - 1e-9:
        error = path.angle(machine.time) - angle[joint]
        integral += error * machine.period
        change = (error - before) / machine.period
        before = error
        wished = path.speed(machine.time + lag) + gain * (
            error + 0.2 * gain * integral + 0.1 * lag * change
        )
        found = model.commands({model.names[joint]: wished}, at=angle)
        angle = machine.step(found.command)
        errors.append(error)
    return float(np.sqrt(np.mean(np.square(errors)))), float(angle[joint])


def main(source: str) -> None:
    """Tune on the plant, and try on draws."""
    model, machine = load_plant(source), load_plant(source)
    arm, joint = model.identified.settings.arm, model.joints[0] - 1
    name = model.names[joint]
    # it may turn without end
    low, high = np.clip([arm.lower[joint], arm.upper[joint]], -np.pi, np.pi)
    pose = model.angle
    pose[joint] = low + START * (high - low)
    top = model.commands({name: 1e3}, at=pose).speed[joint]
    path = Path(pose[joint], low + TARGET * (high - low), FASTEST * top)
    lag = max(float(joint_lags(model)[joint]), model.period)
    ended = {gain / lag: follow(machine, model, path, gain / lag) for gain in GAINS}
    gain = min(ended, key=lambda one: ended[one][0])
    shown = arm.joints[joint].shown
    unit = shown.unit
    factor = shown.factor
    wanted = factor * path.angle(SECONDS)
    print(
        f"{name} after {SECONDS:.0f} s: {factor * ended[gain][1]:.2f} {unit} of {wanted:.2f}"
    )
    print(f"gain {gain:.2g} 1/s, rms error {factor * ended[gain][0]:.3f} {unit}")
    try:
        plants = [*hydroid.draw(source, DRAWS).plants()]
    except hydroid.HydroidError:
        return  # no fit: there is nothing to draw from
    for some in (gain, 2.0 * gain):
        errors = [factor * follow(plant, model, path, some)[0] for plant in plants]
        print(
            f"gain {some:.2g} 1/s on {DRAWS} draws: rms errors {min(errors):.3f} to {max(errors):.3f} {unit}"
        )


if __name__ == "__main__":
    try:
        main(sys.argv[1] if len(sys.argv) > 1 else "article-hyd")
    except hydroid.HydroidError as error:
        sys.exit(f"pid.py: {error}")
