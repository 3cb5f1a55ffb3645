"""How fast a plant steps, as a multiple of real time at 0.01 s (`make bench B=plant`)."""

import time

import numpy as np

from hydroid.plant import load_plant

STEPS, REPEATS = 2000, 5


def main() -> None:
    print("| joints with hydraulics | step [µs] | times real time |")
    print("| --- | --- | --- |")
    for joints in ([2], list(range(1, 8))):
        plant = load_plant("article-hyd", overrides={"start_pose": "study"}, joints=joints)
        moving = np.isin(np.arange(1, 8), joints)
        commands = 30.0 * moving * np.sin(np.arange(STEPS)[:, None] / 50 + np.arange(7))
        took: list[float] = []
        for _ in range(REPEATS):
            plant.reset()
            started = time.perf_counter()
            for command in commands:
                plant.step(command)
            took.append((time.perf_counter() - started) / STEPS)
        print(f"| {len(joints)} | {1e6 * min(took):.0f} | {plant.period / min(took):.0f} |")


if __name__ == "__main__":
    main()
