"""Record of a load path: the arrays that a history keeps of every step."""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import equinox as eqx
from jax import Array

from jbeamshell.common.pytrees import Tree
from jbeamshell.mechanics.kinematics import Strains
from jbeamshell.scene.scene import Scene


class Above(NamedTuple):
    """Fields above the contact line at every step.

    Attributes
    ----------
    fields, sections, member : see `Record`
    """

    fields: Array
    sections: Strains
    member: Array | None = None

    @property
    def found(self) -> Self:
        """The same."""
        return self


class Record(Tree):
    """Arrays of a load path; units are those of the scene.

    Forces, works and what is made of them are per unit of width, or totals where the scene has a
    ``strip.width``.  Stresses, such as ``traction`` and ``reaction``, and fields are what they are.

    Step 0 is the first pressure step; with ``load.pressure_steps`` = 1 that is the strip under the
    whole pressure, before any load.  A step that did not converge and all after it hold NaN.

    Attributes
    ----------
    scene : scene that was solved
    x : (n,) node positions X, from the far end to the loaded end
    middles : (elements,) middle of every element, where the section forces are
    tributary : (n,) contact length of each node
    load : (n,) nodal forces of the whole pressure on the top face
    force : (steps+1,) end force F
    displacement : (steps+1,) mid-height displacement u(L) since the pressure, conjugate to F
    contact_v : (steps+1, n) tangential displacement of the contact, relative to the second member
        if there is one
    above : `Above`, or what has one as ``found``, when somebody reads a field
    fields : (steps+1, n, 4) v, w, beta and psi
    gap : (steps+1, n) height of the strip's bottom face over what it lies on
    sections : (steps+1, elements) section forces N, Q, M, chi and xi in the places of e, g, k, psi
        and psi'
    traction : (steps+1, n) friction traction on the foundation (positive on a pull)
    reaction : (steps+1, n) normal reaction R, positive in compression
    slipping : (steps+1, n) True if the node slipped in the step
    slip_work : (steps+1,) work dissipated by friction in each step
    stored_energy : (steps+1,) strain energy, pressure potential and elastic energy of the contact
    pressure : (steps+1,) part of the pressures that acts
    sinking : (steps+1,) forces of the pressures times their displacement, conjugate to ``pressure``
    iterations : (steps+1,) Newton iterations
    error : (steps+1,) largest out-of-balance force over mu F_N L
    status : (steps+1,) codes of `jbeamshell.Status`
    cycles : steps at the start, the turn and the end of each closed cycle
    target : (steps+1,) prescribed value of the controlled load
    member : (steps+1, n, m) fields v, w, beta, psi, ... of the second member of a lap joint, up and
        along X as those of the strip; None on a rigid base
    change : relative change of the dissipation or the secant stiffness, the larger one, when the
        elements were last halved; None for a grid that was not refined
    overhung : dissipation of a single lap whose overhangs are as long as the overlap where its
        scene leaves them open, over this one's; infinite if only that joint slips, NaN if it found
        no equilibrium, None where nothing is left open
    """

    scene: Scene
    x: Array
    middles: Array
    tributary: Array
    load: Array
    force: Array
    displacement: Array
    contact_v: Array
    above: Any
    gap: Array
    traction: Array
    reaction: Array
    slipping: Array
    slip_work: Array
    stored_energy: Array
    pressure: Array
    sinking: Array
    iterations: Array
    error: Array
    status: Array
    cycles: tuple[tuple[int, int, int], ...] = eqx.field(static=True)
    target: Array | None = None
    change: Array | None = None
    overhung: Array | None = None

    @property
    def pressed(self) -> int:
        """Step at which the whole pressure acts, before any load."""
        return self.scene.load.pressure_steps - 1

    @property
    def fields(self) -> Array:
        """Fields v, w, beta and psi, (steps+1, n, 4)."""
        fields: Array = self.above.found.fields
        return fields

    @property
    def sections(self) -> Strains:
        """Section forces in the places of their strains, (steps+1, elements) each."""
        sections: Strains = self.above.found.sections
        width = self.scene.strip.width
        return sections if width is None else Strains(*(width * s for s in sections))

    def of_scene(self, scene: Scene) -> Self:
        """Record of one unit of width as that of a scene, with totals where it has a width."""
        if scene.strip.width is None:
            return self.but(scene=scene)
        names = ["force", "load", "slip_work", "stored_energy", "sinking"]
        names += ["target"] * (scene.load.control == "force")
        found = {name: scene.wide * getattr(self, name) for name in names}
        return self.but(scene=scene, **found)

    @property
    def member(self) -> Array | None:
        """Fields of the second member of a lap joint, (steps+1, n, m); None on a rigid base."""
        member: Array | None = self.above.found.member
        return member
