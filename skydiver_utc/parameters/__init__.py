"""Validated, frozen parameter sets: the one source of every number the core uses.

Parameters live in YAML below ``config/``; `load_scenario` reads one scenario with everything it names,
checks types, bounds and unknown keys, and returns immutable objects.
"""

from skydiver_utc.parameters.body import (
    JointLimits,
    JointRange,
    Keyframe,
    MovementPattern,
    Pattern,
    Posture,
    PosturePath,
    SegmentData,
    SegmentTable,
    Subject,
    Suit,
)
from skydiver_utc.parameters.controller import (
    OpenLoopParameters,
    PoseControllerParameters,
    UtcParameters,
)
from skydiver_utc.parameters.leaves import Leaf, leaves
from skydiver_utc.parameters.loading import from_yaml, load_scenario, override, scenario_names, to_yaml
from skydiver_utc.parameters.plant import (
    Air,
    Damping,
    Hands,
    InitialCondition,
    Limbs,
    Limits,
    PlantParameters,
)
from skydiver_utc.parameters.reference import (
    ConstantReference,
    PostureReference,
    RotationReference,
    Signal,
    SineReference,
)
from skydiver_utc.parameters.rivals import (
    CostParameters,
    GaussNewtonParameters,
    HorizonParameters,
    LqrParameters,
    MppiParameters,
)
from skydiver_utc.parameters.scenario import Scenario
from skydiver_utc.parameters.yaml_io import ParameterError

__all__ = [
    "Air",
    "ConstantReference",
    "CostParameters",
    "Damping",
    "GaussNewtonParameters",
    "Hands",
    "HorizonParameters",
    "InitialCondition",
    "JointLimits",
    "JointRange",
    "Keyframe",
    "Leaf",
    "Limbs",
    "Limits",
    "LqrParameters",
    "MovementPattern",
    "MppiParameters",
    "OpenLoopParameters",
    "ParameterError",
    "Pattern",
    "PlantParameters",
    "PoseControllerParameters",
    "Posture",
    "PosturePath",
    "PostureReference",
    "RotationReference",
    "Scenario",
    "SegmentData",
    "SegmentTable",
    "Signal",
    "SineReference",
    "Subject",
    "Suit",
    "UtcParameters",
    "from_yaml",
    "leaves",
    "load_scenario",
    "override",
    "scenario_names",
    "to_yaml",
]
