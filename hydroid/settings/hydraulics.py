"""The hydraulics of an arm, from command to chamber pressure, in the units of a drawing or data sheet.

The ten numbers that the article calls true stand here and in the arm's file (areas). All others are ours:
plausible sizes, not measurements of a HydroLek. Each holds for every actuator of the arm; a parameter of a
fit sets or frees it joint by joint.
"""

from typing import Annotated

from pydantic import Field

from hydroid.settings.load import Settings

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]

HYDRAULIC_UNITS: dict[str, tuple[str, float]] = {
    "area_a": ("mm²", 1e-6),  # of a rotary actuator the displacement, cm³/rad: the same factor
    "area_b": ("mm²", 1e-6),
    "opening_a": ("mm²", 1e-6),
    "opening_b": ("mm²", 1e-6),
    "onset_a": ("V", 1.0),
    "full_a": ("V", 1.0),
    "onset_b": ("V", 1.0),
    "full_b": ("V", 1.0),
    "current_max": ("A", 1.0),
    "current_min": ("A", 1.0),
    "force_1": ("N", 1.0),
    "force_2": ("N", 1.0),
    "stroke_1": ("mm", 1e-3),
    "stroke_2": ("mm", 1e-3),
    "rated_current": ("A", 1.0),
    "plunger_mass": ("kg", 1.0),
    "plunger_damping": ("N·s/m", 1.0),
    "plunger_stiffness": ("N/mm", 1e3),
    "slot_width": ("mm", 1e-3),
    "overlap_a": ("mm", 1e-3),
    "overlap_b": ("mm", 1e-3),
    "opening_exponent": ("", 1.0),
    "leakage": ("mm²", 1e-6),
    "flow_coefficient": ("", 1.0),
    "transition_pressure": ("bar", 1e5),
    "flow_limit": ("L/min", 1e-3 / 60.0),
    "supply_pressure": ("bar", 1e5),
    "tank_pressure": ("bar", 1e5),
    "vapour_pressure": ("bar", 1e5),
    "density": ("kg/m³", 1.0),
    "bulk_modulus": ("bar", 1e5),
    "dead_volume": ("cm³", 1e-6),
    "dry_friction": ("N", 1.0),
    "stop_penetration": ("N·s/m²", 1.0),
    "delay": ("s", 1.0),
}
"""Unit of every quantity of an actuator, and the factor that turns it into SI."""


class HydraulicSettings(Settings):
    """All numbers of the actuator chain but areas and openings, which the arm's file has joint by joint."""

    onset_a: float = 1.4
    """A of equation (2) [V], article"""
    full_a: float = 10.0
    """B of (2) [V]"""
    onset_b: float = 1.2
    """C of (3) [V], article"""
    full_b: float = 10.0
    """D of (3) [V]"""
    current_max: Positive = 0.9
    """I_max of (4) [A], article"""
    current_min: Positive = 0.3
    """I_min of (4) [A], article"""
    force_1: Positive = 8.0
    """solenoid force at stroke_1 and rated current [N], article"""
    force_2: Positive = 0.7
    """the same at stroke_2 [N], article"""
    stroke_1: Positive = 0.8
    """[mm], article"""
    stroke_2: Positive = 12.0
    """[mm], article"""
    rated_current: Positive = 0.9
    """[A]"""
    plunger_mass: Positive = 0.05
    """m of (5) [kg]"""
    plunger_damping: NotNegative = 20.0
    """λ of (5) [N·s/m]"""
    plunger_stiffness: Positive = 2.0
    """K of (5) [N/mm]"""
    plunger_dynamics: bool = True
    """false: plungers follow their current at once"""
    slot_width: Positive = 2.0
    """w of (7): spool travel from first to full opening [mm]"""
    overlap_a: NotNegative = 0.0
    """spool travel before anything opens, towards A [mm]"""
    overlap_b: NotNegative = 0.0
    """the same towards B [mm]"""
    opening_exponent: Positive = 1.0
    """1: the opening grows in proportion to the stroke; above 1: faster towards its end"""
    leakage: NotNegative = 1e-4
    """of every metering edge, open or shut [mm²]"""
    flow_coefficient: Positive = 0.7
    """C_q of (7)"""
    transition_pressure: Positive = 0.2
    """drop below which flow is laminar [bar]"""
    flow_limit: Positive | None = None
    """most that the pump gives to one actuator [L/min]; null: no limit"""
    supply_pressure: Positive = 150.0
    """[bar]"""
    tank_pressure: NotNegative = 5.0
    """[bar]"""
    vapour_pressure: NotNegative = 0.0
    """the least a chamber pressure can be [bar]"""
    density: Positive = 860.0
    """of the oil [kg/m³]"""
    bulk_modulus: Positive = 8000.0
    """β of the oil [bar]; a hundred times as much is the article's stiff oil"""
    dead_volume: Positive = 30.0
    """of a cylinder's chamber with the rod at that end, hoses included [cm³]"""
    rotary_volume: Positive = 50.0
    """of a rotary actuator's chamber [cm³]"""
    dry_friction: NotNegative = 0.0
    """of the seals [N]; of a rotary actuator [N·m]"""
    stop_penetration: NotNegative = 1e10
    """K_p of (9): force of the stops per penetration and speed [N·s/m²]"""
    delay: Annotated[float, Field(ge=0, le=5)] = 0.0
    """transport delay of the command [s]"""
    start_pressure: Positive = 50.0
    """level of the rod side's pressure at the start, which static balance leaves open [bar]"""
    substeps: Annotated[int, Field(ge=1, le=100)] = 3
    """sub-steps of valves and oil in one MuJoCo step"""
