"""Parameters in plain words: what each quantity is, for readers who do not know its symbol."""

from hydroid.settings.fit import FitSettings

_MEANINGS = {
    "gain": "torque per command",
    "damping": "damping of the joint",
    "stiffness": "spring of the joint",
    "friction": "dry friction of the joint",
    "mass": "mass",
    "area": "piston area",
    "area_a": "piston area opposite the rod",
    "area_b": "piston area on the rod's side",
    "opening": "largest valve opening",
    "pivot_distance_1": "distance of the cylinder's first pivot from the axis",
    "pivot_distance_2": "distance of the cylinder's second pivot from the axis",
    "pivot_angle": "angle between the cylinder's pivots",
    "onset": "voltage at the smallest command",
    "full": "voltage at full command",
    "dead_band": "command below which nothing moves",
    "current_max": "largest coil current",
    "current_min": "smallest coil current",
    "force_1": "solenoid force at the first stroke",
    "force_2": "solenoid force at the second stroke",
    "stroke_1": "plunger stroke of the first force",
    "stroke_2": "plunger stroke of the second force",
    "rated_current": "rated coil current",
    "plunger_mass": "mass of the plunger",
    "plunger_damping": "damping of the plunger",
    "plunger_stiffness": "spring of the plunger",
    "slot_width": "spool travel to full opening",
    "overlap": "spool travel before the valve opens",
    "opening_exponent": "shape of the valve's curve",
    "return": "return edge relative to the pump edge",
    "anticavitation": "opening of the anti-cavitation valve",
    "leakage": "leakage area of the valve",
    "flow_coefficient": "flow coefficient",
    "transition_pressure": "pressure drop of laminar flow",
    "flow_limit": "largest flow to one actuator",
    "pump_flow": "largest flow of the pump",
    "pump_droop": "fall of the supply pressure with flow",
    "pump_idle": "idle share of the pump's flow",
    "pump_delay": "delay of the pump",
    "pump_rise": "time in which the pump comes up",
    "line_volume": "oil between pump and valves",
    "supply_pressure": "supply pressure",
    "tank_pressure": "tank pressure",
    "vapour_pressure": "lowest chamber pressure",
    "density": "density of the oil",
    "bulk_modulus": "stiffness of the oil",
    "dead_volume": "dead volume of the cylinder",
    "dry_friction": "friction of the cylinder's seals",
    "stop_penetration": "stiffness of the end stops",
    "start_pressure": "pressure at the start",
    "trapped_pressure": "pressure trapped at a stop",
    "delay": "transport delay",
    "sensor_scale": "scale of the angle's sensor",
    "sensor_lag": "lag of the angle's sensor",
}
_SIDES = {"_a": ", towards A", "_b": ", towards B"}


def plain_name(settings: FitSettings, parameter: str) -> str:
    """Say in plain words what a parameter is, and where it acts if several joints are compared."""
    own = settings.parameters[parameter]
    quantity = own.quantity
    side = "" if quantity in _MEANINGS else _SIDES.get(quantity[-2:], "")
    meaning = _MEANINGS.get(quantity) or _MEANINGS.get(quantity[:-2], quantity.replace("_", " "))
    if own.link is not None:
        return f"{meaning} of {own.link}"
    joints = [] if len(settings.outputs) == 1 else own.joints or []
    where = f", {settings.arm.joint_names[joints[0] - 1]}" if len(joints) == 1 else ""
    return f"{meaning}{side}{where}"
