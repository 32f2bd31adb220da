r"""Joint as a law of points: sliders in parallel, of a strip, of another law or of measurements.

Parallel sliders have a backbone F(u) that is linear between points: where its slope falls by s at
u, a spring of stiffness s starts to slip at the force s u; a spring with the last slope remains
(Iwan 1966).  Their loops follow Masing's rule exactly: the branch from U is F(U) - 2 F((U-u)/2).
A joint is known up to the last point of its backbone.  If that point is gross slip, the force stays
there, and the joint is known everywhere; beyond any other last point nothing is known.
A strip or a lap joint becomes the element whose loops are nearest to its steady cycles.  The paths
of its own contact, on which pull and push differ, stay at hand.
"""

from __future__ import annotations

import dataclasses
import os
import warnings
from pathlib import Path
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import (
    as_leaf,
    is_traced,
    require,
    require_number,
)
from jbeamshell.common.errors import DoubtfulWarning
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.progress import patience
from jbeamshell.common.summary import Summary, with_unit
from jbeamshell.dynamics.export import table
from jbeamshell.dynamics.export.element import Element
from jbeamshell.dynamics.export.targets import write
from jbeamshell.dynamics.structure.steady_backbone import steady_backbone, walked_forces
from jbeamshell.laws.law import Law, as_path
from jbeamshell.laws.parallel_iwan import NEARLY, ParallelIwan, backbone_points
from jbeamshell.scene.domain import gross_slip_rule
from jbeamshell.scene.mounting import in_words
from jbeamshell.scene.scene import Scene

BACKBONE = "give as many displacements as forces, both rising from above zero, softening throughout"
SIDES = "give the displacements of pull and push, (2, k), both positive, at the forces"
DOUBTED_ASYMMETRY = 0.05  # of an exported joint
GROSS = 0.99  # force over that of gross slip from which on the last point counts as gross slip
FLAT = 1e-9  # last slope over the first one that counts as zero


class Joint(ParallelIwan):
    """Law between two points of a structure, given by points of its backbone.

    Attributes
    ----------
    displacements, forces : (k,) points of the backbone.  At .99 of the capacity or more a point on
        the plateau of gross slip follows the given ones
    width : width whose forces these are; 1 where they are those of one unit of it
    capacity : force of gross slip; infinite if it is not known
    sides : (2, k) displacements of a first pull and of a first push at the forces; None if they are
        the backbone's
    scene : scene on its contact line behind it, for `path_forces`; None if there is none
    mounting : how a lap joint is held and loaded, in words; empty for any other joint

    Raises
    ------
    InputError
        for a backbone that does not rise or that stiffens

    Examples
    --------
    >>> joint = Joint(displacements=[1.0, 3.0], forces=[1.0, 2.0])
    >>> joint.springs.tolist(), joint.limits.tolist(), float(joint.spring)
    ([0.5], [0.5], 0.5)
    """

    heading: ClassVar[str] = "joint"

    displacements: Any
    forces: Any
    width: Any = 1.0
    capacity: Any = np.inf
    sides: Any = None
    scene: Scene | None = None
    mounting: str = eqx.field(static=True, default="")

    def __post_init__(self) -> None:
        for name in ("displacements", "forces"):
            setattr(self, name, as_leaf(getattr(self, name), f"joint.{name}", BACKBONE))
        for name in ("width", "capacity"):
            setattr(self, name, as_leaf(getattr(self, name), f"joint.{name}"))
        if self.sides is not None:
            self.sides = as_leaf(self.sides, "joint.sides", SIDES)
        if self._ends_in_gross_slip:
            self.forces = jnp.append(self.forces, self.forces[-1])
            self.displacements = _longer(self.displacements)
            self.sides = None if self.sides is None else _longer(self.sides)

    def __check_init__(self) -> None:
        if is_traced(self.displacements, self.forces):
            return
        u, f = np.asarray(self.displacements), np.asarray(self.forces)
        if self.sides is not None:
            shape = self.sides.shape
            require("joint.sides", shape, shape == (2, u.size), SIDES)
        paired = u.ndim == 1 and u.shape == f.shape and u.size > 0
        require("joint.forces", f.shape, paired, BACKBONE)
        slopes = np.diff(f, prepend=0.0) / np.diff(u, prepend=0.0)
        rising = bool(np.all(np.diff(u, prepend=0.0) > 0.0) and np.all(slopes >= 0.0))
        rounding = np.finfo(u.dtype).eps * u[1:] / np.diff(u)  # of slopes, where points lie close
        softening = bool(np.all(np.diff(slopes) <= (1e-9 + 4.0 * rounding) * slopes[0]))
        require("joint.forces", f, rising and softening and slopes[0] > 0.0, BACKBONE)

    @classmethod
    @patience("finding the joint")
    def of(cls, scene: Scene | Law, force: Any = None) -> Joint:
        """Joint whose loops are nearest to the steady cycles of a scene, or those of a law.

        Displacement and energy of the cycles are matched from a fiftieth of the largest force on.
        A scene that leaves its section open is plane elasticity, which alone is close at all
        amplitudes.

        A law of Masing's rule gives its sliders, or those on 160 points of its backbone, within
        1 % of its energy, see `jbeamshell.laws.parallel_iwan.backbone_points`.  A law that was
        fitted to data below its gross slip gives a joint that ends where they did.

        All numbers may be traced by `jax.jit` and `jax.grad`.  A traced scene cannot tell whether a
        step failed: the joint then holds NaN.

        Parameters
        ----------
        scene : scene of the strip or the lap joint, whose load path is not used; or law
        force : largest end force, below gross slip, as the scene has forces: a total where it has
            a ``strip.width``.  None is ``load.amplitude``, and gross slip of a law, or the largest
            force to which it was fitted

        Raises
        ------
        InputError
            for a force that is not positive, a force beyond gross slip, or a law without Masing's
            memory
        UnconvergedError
            for a scene without equilibrium

        Examples
        --------
        >>> joint = Joint.of(jb.Scene(), 1.2)
        >>> joint.dissipation(joint.displacements[-1])  # energy per cycle
        >>> Joint.of(jb.laws.Iwan4(slip_force=2.0, stiffness=100.0)).times(3.0)
        """
        if isinstance(scene, Law):
            capacity: Any = scene.capacity
            if force is None and np.isfinite(scene.fitted_to):
                force = jnp.minimum(scene.backbone(scene.fitted_to), NEARLY * scene.capacity)
                capacity = np.inf  # which no data showed
            u, f = backbone_points(scene, force)
            return cls(u, f, 1.0, capacity)
        force = largest_force(scene, force)
        if scene.load.control != "force":
            scene = scene.replace({"load.control": "force", "load.amplitude": force})
        bolted = scene.member.bolt_stiffness is not None  # which holds beyond
        capacity = np.inf if bolted else scene.gross_slip
        u, f, sides = steady_backbone(scene, as_leaf(force, "force"))
        traced = is_traced(scene, force)
        walked = scene if scene.plan.on_contact_line and not traced else None
        mounting = "" if traced else in_words(scene)
        return cls(u, f, _own_width(scene), capacity, sides, walked, mounting)

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Joint:
        """Joint of a table, such as `export` writes: CSV or MATLAB.

        Backbone, width, capacity, pull and push come back; a table of another origin that does not
        say them has a width of 1 and no known capacity.

        Raises
        ------
        InputError
            for a file that holds no columns ``displacement`` and ``force``, or no backbone
        """
        u, f, about = table.read(path)
        return cls(u, f, **about)

    def times(self, number: Any) -> Joint:
        """So many of the joint side by side: forces times a number, such as a width.

        Raises
        ------
        InputError
            for a number that is not positive

        Examples
        --------
        >>> Joint([1.0, 3.0], [1.0, 2.0]).times(10.0).forces.tolist()
        [10.0, 20.0]
        """
        require_number("number of joints", number)
        names = ("forces", "width", "capacity")
        return self.but(**{name: number * getattr(self, name) for name in names})

    def in_series(self, stiffness: Any) -> Joint:
        """Joint with a spring in series, which its points then contain.

        The loops remain those of sliders.  Pull and push keep their difference, and paths are
        those of the mean.

        Parameters
        ----------
        stiffness : stiffness of the spring, force over displacement; may be traced

        Raises
        ------
        InputError
            for a stiffness that is not positive

        Examples
        --------
        >>> Joint([1.0, 3.0], [1.0, 2.0]).in_series(1.0).displacements.tolist()
        [2.0, 5.0]
        """
        require_number("series stiffness", stiffness)
        more = self.forces / as_leaf(stiffness, "series stiffness")
        u, sides = self.displacements + more, None if self.sides is None else self.sides + more
        return self.but(displacements=u, sides=sides, scene=None)

    @property
    def asymmetry(self) -> Array:
        """Largest difference of pull and push from their mean at a force, over the mean."""
        if self.sides is None:
            return jnp.zeros(())
        return jnp.max(jnp.abs(self.sides[0] - self.sides[1]) / (self.sides[0] + self.sides[1]))

    @property
    def springs(self) -> Array:
        """Stiffnesses (k-1,) of the sliders."""
        return -jnp.diff(self._slopes)

    @property
    def slips(self) -> Array:
        """Displacements (k-1,) at which the sliders slip on first loading."""
        return self.displacements[:-1]

    @property
    def spring(self) -> Array:
        """Stiffness of the spring that remains beyond the last point but one."""
        return self._slopes[-1]

    @property
    def reach(self) -> Array:
        """Largest displacement at which the joint is known; infinite if it ends in gross slip."""
        slopes = self._slopes
        return jnp.where(slopes[-1] <= FLAT * slopes[0], jnp.inf, self.displacements[-1])

    @property
    def below_gross_slip(self) -> tuple[Array, Array]:
        """Displacements and forces of the points up to the largest force, without a plateau."""
        count = 1 + int(jnp.argmax(self.forces >= self.forces[-1]))
        return self.displacements[:count], self.forces[:count]

    @property
    def _slopes(self) -> Array:
        """Slopes (k,) of the backbone's segments."""
        zero = jnp.zeros(1)
        rise = jnp.diff(jnp.append(zero, self.forces))
        return rise / jnp.diff(jnp.append(zero, self.displacements))

    def unknown_at(self, u: float) -> str:
        """Words of an error at a displacement beyond the reach, with the fix."""
        capacity, top = float(self.capacity), float(self.forces[-1])
        if np.isfinite(capacity):
            own = 1.0 if self.scene is None else float(_own_width(self.scene))
            level = 0.5 * (1.0 + GROSS) * capacity / float(self.width) * own
            fix = f"give Joint.of the force {level:.6g}, or points up to there: this is "
            fix += "nearly gross slip, beyond which the force is known"
        else:
            fix = "give more points or, of a law, a larger force; or give "
            fix += f"capacity={top:.6g} if it slides at this force (gross slip)"
        return (
            f"{u:.4g}, beyond its backbone, which ends at {float(self.displacements[-1]):.4g} and "
            f"the force {top:.4g}, below gross slip: take less, or {fix}"
        )

    def backbone(self, u: ArrayLike, *, mean: bool = True) -> Array:
        """Force on first loading; any shape.

        Parameters
        ----------
        u : displacement, positive for a pull
        mean : True for the mean of pull and push, an odd function; False for each its own

        Raises
        ------
        InputError
            for a displacement beyond the `reach`, here and below; traced ones give NaN there
        """
        u = jnp.asarray(u)
        if not mean and self.sides is not None:
            pull, push = (self.but(displacements=side) for side in self.sides)
            return pull.backbone(jnp.maximum(u, 0.0)) + push.backbone(jnp.minimum(u, 0.0))
        return super().backbone(u)

    def displacement(self, force: ArrayLike) -> Array:
        """Displacement amplitude of a force amplitude; any shape.

        Raises
        ------
        InputError
            for a force beyond the last point; traced ones give NaN there
        """
        size, top = jnp.abs(jnp.asarray(force)), self.forces[-1]
        within = size <= top
        if not is_traced(within):
            largest = float(jnp.max(size, initial=0.0))
            fix = f"is beyond the last point of the backbone: ask for {float(top):.6g} or less"
            require("force of joint", largest, bool(np.all(within)), fix)
        u, f = jnp.append(0.0, self.displacements), jnp.append(0.0, self.forces)
        return nan_unless(within, jnp.interp(size, f, u))

    def path_forces(self, path: ArrayLike) -> Array:
        """Forces (T,) on a path (T,) of displacements, which starts with unloaded sliders.

        Those of a strip or a lap joint on its contact line are its own, pull and push apart, and
        not those of the mean backbone.

        Raises
        ------
        InputError
            for a path beyond the `reach` of a joint that has only its backbone
        UnconvergedError
            for a path without equilibrium
        """
        points = as_path(path)
        if self.scene is not None and not is_traced(self.scene):
            number = self.width / _own_width(self.scene)
            return number * walked_forces(self.scene, np.asarray(points))
        return super().path_forces(self._where_known(points, points))

    def export(
        self,
        to: str,
        path: str | os.PathLike[str],
        *,
        units: tuple[str, str] = ("length", "force"),
    ) -> Path:
        """Write the joint for another program; returns the path.

        Parameters
        ----------
        to : ``opensees`` (OpenSeesPy lines), ``fmu`` (FMI 2 co-simulation), ``tmdsimpy`` (its
            forces), ``calculix`` (cards for CalculiX and Abaqus) or ``table`` (CSV or MATLAB)
        path : file, which says width, units, sign and limits
        units : names of the scene's units of length and force, for the file alone

        Raises
        ------
        InputError
            for an unknown target, a traced joint, another ending of the file's name, a file that
            cannot be written, or a library that is missing

        Warns
        -----
        DoubtfulWarning
            if pull and push differ by more than a twentieth from the exported mean

        Examples
        --------
        ::

            Joint.of(scene.of_width(30.0), 36.0).export("opensees", "joint.py", units=("mm", "N"))
        """
        require("joint", "traced", not is_traced(self), "export it outside jit, grad and vmap")
        words = isinstance(units, tuple | list) and len(units) == 2 and all(map(_is_word, units))
        require("units", units, words, "name those of length and force, such as ('mm', 'N')")
        written = write(Element(self, (units[0], units[1])), to, path)
        if self.asymmetry > DOUBTED_ASYMMETRY:
            apart = f"{float(self.asymmetry):.0%}"
            text = f"doubtful: pull and push differ by {apart} of u from their mean"
            fix = "which is exported; joint.path_forces has each way exactly"
            warnings.warn(f"{text}, {fix}", DoubtfulWarning, stacklevel=2)
        return written

    @property
    def summary(self) -> Summary:
        """Summary in a few lines."""
        if is_traced(self):
            return Summary("joint, traced", [])
        count, end, top = self.limits.size, float(self.displacements[-1]), float(self.forces[-1])
        if np.isinf(self.reach):
            known = f"everywhere: it slides at {top:.4g}"
        else:
            known = f"up to the displacement {end:.4g} and the force {top:.4g}"
        rows = [("stiffness", with_unit(float(self.stiffness))), ("known", known)]
        if np.isfinite(self.capacity):
            rows.append(("gross slip", with_unit(float(self.capacity))))
        rows.append(("pull and push", f"differ from their mean by {float(self.asymmetry):.2%}"))
        rows.append(("width", with_unit(float(self.width)) + self._forces))
        notes = [self.mounting] if self.mounting else []
        return Summary(f"joint of {count} slider{'s' * (count != 1)}", rows, notes)

    @property
    def _forces(self) -> str:
        """Words for what the forces of a scene are; empty where nothing is known of its width."""
        if self.scene is None:
            return ""
        per_unit = self.scene.strip.width is None and float(self.width) == 1.0
        return ", forces per unit of width" if per_unit else ", forces are totals"

    def __str__(self) -> str:
        return self.summary.as_text()

    def _repr_html_(self) -> str:
        """Summary, for a notebook."""
        return self.summary.as_html()

    @property
    def _ends_in_gross_slip(self) -> bool:
        """True if the last point is gross slip, and no plateau follows yet."""
        u, f = self.displacements, self.forces
        paired = u.ndim == 1 and u.shape == f.shape and u.size > 0
        if is_traced(u, f, self.capacity) or not paired or np.ndim(self.capacity):
            return False
        rising = f.size == 1 or float(f[-1]) > float(f[-2])
        return rising and float(f[-1]) >= GROSS * float(self.capacity)


def _own_width(scene: Scene) -> Any:
    """Width of a scene, 1 where its forces are those of one unit of it."""
    return 1.0 if scene.strip.width is None else scene.strip.width


def largest_force(scene: Scene, force: Any = None) -> Any:
    """Force up to which a joint is wanted, checked; None is the scene's amplitude.

    It is a total where the scene has a width.
    """
    key = "force" if force is not None else "load.amplitude"
    if force is None:
        control = scene.load.control
        fix = "is no force: give force=, or take load.control = 'force'"
        require("load.amplitude", scene.load.amplitude, control == "force", fix)
        force = scene.get("load.amplitude")
    require_number("force", force)
    if not is_traced(scene, force):
        by_force = dataclasses.replace(scene.load, control="force")
        rule = gross_slip_rule(by_force, scene.member, scene.number, force / scene.wide)
        limit = float(scene.gross_slip)
        fix = f"must stay below gross slip, mu F_N L = {limit:.6g}: take less, such as half of it, "
        rule._replace(key=key, fix=f"{fix}{0.5 * limit:.4g}").demand()
    return force


def _longer(places: Array) -> Array:
    """Displacements (..., k + 1) with a point on the plateau of gross slip."""
    return jnp.append(places, 2.0 * places[..., -1:], axis=-1)


def _is_word(text: object) -> bool:
    """True for printable text of one line, which a file can hold."""
    return isinstance(text, str) and 0 < len(text) < 30 and text.isascii() and text.isprintable()
