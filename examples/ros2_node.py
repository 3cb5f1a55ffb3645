"""A fitted arm as a ROS 2 node: `python examples/ros2_node.py RUN`, in a shell where
ROS 2 is sourced.

It takes commands [%] from the topic `command` (sensor_msgs/JointState: `name`, and in
`effort` the commands), steps the plant in real time, and publishes the joints' angles
[rad] and speeds on `joint_states`. A command holds until the next one; joints that a
message does not name keep theirs.
"""

import sys
from typing import Any

from hydroid.plant import Plant, load_plant


class ArmNode:
    """The plant of a run between two topics; `node` is a node of rclpy, `message` makes
    a JointState."""

    def __init__(self, node: Any, message: Any, plant: Plant) -> None:
        self.plant, self.command = (
            plant,
            dict.fromkeys((plant.names[j - 1] for j in plant.joints), 0.0),
        )
        self._node, self._message = node, message
        self._angle = plant.reset()
        self._publisher = node.create_publisher(message, "joint_states", 10)
        node.create_subscription(message, "command", self.take, 10)
        node.create_timer(plant.period, self.step)

    def take(self, given: Any) -> None:
        """Take over the commands of a message; say which of its joints take none."""
        for name, value in zip(given.name, given.effort, strict=False):
            if name in self.command:
                self.command[name] = float(value)
            else:
                self._node.get_logger().warning(
                    f"{name} takes no command; those that do: {[*self.command]}"
                )

    def step(self) -> None:
        """Go on by one period and publish where the arm is."""
        before, self._angle = self._angle, self.plant.step(self.command)
        state = self._message()
        state.header.stamp = self._node.get_clock().now().to_msg()
        state.name = [*self.plant.names]
        state.position = self._angle.tolist()
        state.velocity = ((self._angle - before) / self.plant.period).tolist()
        self._publisher.publish(state)


def main(run: str) -> None:
    """Spin until the node is stopped."""
    import rclpy  # pyright: ignore[reportMissingImports]  # of ROS 2, not of Python's index
    from sensor_msgs.msg import JointState  # pyright: ignore[reportMissingImports]

    rclpy.init()
    node = rclpy.create_node("hydroid_arm")
    ArmNode(node, JointState, load_plant(run))
    rclpy.spin(node)


if __name__ == "__main__":
    main(sys.argv[1])
