"""The chain from command to joint torque (article 2.1, 2.2): one file a component,
`actuator` chains them."""
