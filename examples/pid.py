"""A PID controller on the shoulder: `python examples/pid.py [RUN]` steps a fitted arm, or the shipped one."""

import sys

import numpy as np

from hydroid.plant import load_plant

SHOULDER, TARGET = 1, np.radians(30)
KP, KI, KD = 400.0, 40.0, 10.0  # [%/rad], [%/(rad s)], [% s/rad]

plant = load_plant(sys.argv[1] if len(sys.argv) > 1 else "article-hyd")
angle = plant.reset("study")
integral, before = 0.0, TARGET - angle[SHOULDER]
while plant.time < 10.0:
    error = TARGET - angle[SHOULDER]
    integral += error * plant.period if abs(error) < np.radians(2) else 0.0
    command = np.zeros(len(angle))
    command[SHOULDER] = KP * error + KI * integral + KD * (error - before) / plant.period
    before = error
    angle = plant.step(command)
print(f"shoulder after {plant.time:.0f} s: {np.degrees(angle[SHOULDER]):.2f} deg of {np.degrees(TARGET):.0f}")
