"""A PID controller on a joint: `python examples/pid.py [RUN]` steps a fitted arm, or the shipped one."""

import sys

import numpy as np

from hydroid.plant import load_plant

KP, KI, KD = 800.0, 400.0, 20.0  # [% per travel], [% per travel and second], [% second per travel]
START, TARGET = 0.5, 0.75  # of the joint's travel

plant = load_plant(sys.argv[1] if len(sys.argv) > 1 else "article-hyd")
arm = plant.identified.settings.arm
joint = plant.joints[0] - 1  # the first that takes commands
low, high = np.clip([arm.lower[joint], arm.upper[joint]], -np.pi, np.pi)  # it may turn without end
pose, target = plant.reset(), low + TARGET * (high - low)
pose[joint] = low + START * (high - low)

# a positive command lowers the angle of some joints
angle = plant.reset(pose)
while plant.time < 1.0:
    angle = plant.step({plant.names[joint]: 100.0})
sense = 1.0 if angle[joint] > pose[joint] else -1.0

angle = plant.reset(pose)
integral, before = 0.0, (target - angle[joint]) / (high - low)
while plant.time < 10.0:
    error = (target - angle[joint]) / (high - low)
    integral += error * plant.period if abs(error) < 0.02 else 0.0
    command = KP * error + KI * integral + KD * (error - before) / plant.period
    before = error
    angle = plant.step({plant.names[joint]: sense * command})

unit, factor = ("mm", 1e3) if arm.joints[joint].slides else ("deg", np.degrees(1.0))
reached, wanted = factor * angle[joint], factor * target
print(f"{plant.names[joint]} after {plant.time:.0f} s: {reached:.2f} {unit} of {wanted:.2f}")
