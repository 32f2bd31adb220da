"""Co-simulation slave of a joint, the program inside an exported FMU; pure Python.

The folder of its resources holds ``joint.json`` with the sliders.
"""

import json
from pathlib import Path
from typing import Any

from pythonfmu import Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Real
from pythonfmu.enums import Fmi2Status


class JointOfSliders(Fmi2Slave):
    """Sliders in parallel with a spring; each step goes straight to the displacement given."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        text = (Path(options["resources"]) / "joint.json").read_text(encoding="utf-8")
        self.numbers = json.loads(text)
        self.description = self.numbers["about"]
        self.displacement = self.force = self.dissipated = self.reached = 0.0
        self.stiffness = self.numbers["spring"] + sum(k for k, _ in self.numbers["sliders"])
        self.tractions = [0.0] * len(self.numbers["sliders"])
        self.warned = False
        length, force = self.numbers["units"]
        for name, causality, words in (
            ("displacement", Fmi2Causality.input, f"u in {length}, positive in a pull"),
            ("force", Fmi2Causality.output, f"F in {force}, which moves the end by u"),
            ("stiffness", Fmi2Causality.output, f"dF/du of the last step in {force}/{length}"),
            ("dissipated", Fmi2Causality.output, f"work of friction so far in {force} {length}"),
        ):
            kind: dict[str, Any] = {
                "causality": causality,
                "variability": Fmi2Variability.continuous,
            }
            if causality == Fmi2Causality.output:
                kind["initial"] = Fmi2Initial.exact
            self.register_variable(Real(name, description=words, **kind))

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Move to the displacement of the input."""
        u, self.force = self.displacement, self.numbers["spring"] * self.displacement
        self.stiffness = self.numbers["spring"]
        for j, (stiffness, limit) in enumerate(self.numbers["sliders"]):
            trial = self.tractions[j] + stiffness * (u - self.reached)
            traction = min(max(trial, -limit), limit)
            self.dissipated += limit * abs(trial - traction) / stiffness
            self.stiffness += stiffness if trial == traction else 0.0
            self.tractions[j] = traction
            self.force += traction
        self.reached = u
        if abs(u) > self.numbers["reach"] and not self.warned:
            self.warned = True
            self.log(f"|u| = {abs(u):g} is beyond the joint's range", Fmi2Status.warning)
        return True

    def _get_fmu_state(self) -> dict[str, Any]:
        memory = {"tractions": list(self.tractions), "reached": self.reached}
        outputs = ("displacement", "force", "stiffness", "dissipated")
        return memory | {name: getattr(self, name) for name in outputs}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            setattr(self, name, list(value) if isinstance(value, list) else value)
