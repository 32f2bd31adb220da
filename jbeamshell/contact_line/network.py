"""Strip as a network of sliders in series, exact for every history of its end load.

A branch of load adds sliders with thresholds dF_k and compliances z_k y_gk to the spring c of the
clamped contact (see `branches`), so that displacement and force are a rising piecewise line of each
other.  The compliances depend on the sense of the branch alone; the thresholds on the tractions and
reactions at its start, which are the network's memory.  Without the coupling K_nt, f_n of slip and
reaction both senses are alike, a reversal doubles the thresholds, and the network is Iwan's.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.common.checks import require
from jbeamshell.common.failed import nan_unless
from jbeamshell.contact_line.body import Body
from jbeamshell.contact_line.branches import ContactState, Factors, factorise, follow, path, pressed
from jbeamshell.contact_line.cycles import STEADY
from jbeamshell.contact_line.drives import with_springs
from jbeamshell.contact_line.strip import condensed, moving_volume, spring_stiffness
from jbeamshell.scene.scene import Scene

STUCK = "nothing slips under it, so that it has no sliders: take more of gross slip, mu F_N L"
SOFTENS = 1e-9  # of the first compliance: a corner of a backbone where it rises by less is none


class Sliders(NamedTuple):
    """Sliders of one branch, in the order of their events, and the corners of its piecewise line.

    Attributes
    ----------
    force : (k + 1,) changes of force at the corners, from 0
    displacement : (k + 1,) changes of displacement there
    compliance : (k + 1,) slopes of the displacement after each corner
    """

    force: Array
    displacement: Array
    compliance: Array

    def force_after(self, displacement: Array) -> Array:
        """Change of force at a change of displacement, both positive; any shape."""
        segment = jnp.searchsorted(self.displacement, displacement, side="right") - 1
        beyond = displacement - self.displacement[segment]
        return self.force[segment] + beyond / self.compliance[segment]

    def displacement_after(self, force: Array) -> Array:
        """Change of displacement at a change of force, both positive; any shape."""
        segment = jnp.searchsorted(self.force, force, side="right") - 1
        beyond = force - self.force[segment]
        return self.displacement[segment] + beyond * self.compliance[segment]


class Response(NamedTuple):
    """Network at points of a path, stacked along the first axis.

    Attributes
    ----------
    state : contact
    slip_work : work of friction since the path's start
    valid : True as long as the slip zones were nested
    """

    state: ContactState
    slip_work: Array
    valid: Array


class Network(eqx.Module):
    """Network of sliders of a strip; forces are per unit width.

    Attributes
    ----------
    body : strip on its contact line
    factors : its factors for both senses of slip
    friction : mu
    volume : (layers,) part of each layer's volume per width that moves with the loaded end while
        the contact sticks, the integral of |u|^2/u(L)^2 (Rayleigh)
    """

    body: Body
    factors: Factors
    friction: Array
    volume: Array

    @classmethod
    def of(cls, scene: Scene) -> Network:
        """Network of a scene on its contact line, whose load is not used; may be traced.

        Slip of elastic sliders is the plastic one.
        """
        strip, friction = condensed(scene, scene.plan.nodes), scene.contact.friction
        body = strip.body
        if scene.contact.stick_stiffness is not None:
            body, _ = with_springs(body, spring_stiffness(scene, strip))
        return cls(body, factorise(body, friction), friction, moving_volume(strip))

    @classmethod
    def nearest(cls, scene: Scene, displacement: Array, force: Array) -> Network:
        """Network of a backbone that is nearest to a scene whose slip zones are not nested.

        Parameters
        ----------
        scene : scene on its contact line, for the mass that moves
        displacement, force : (k,) points of the backbone, see `in_series`

        Raises
        ------
        InputError
            for a backbone along which nothing slips
        """
        volume = jax.jit(lambda scene: moving_volume(condensed(scene, scene.plan.nodes)))
        slopes = jnp.diff(displacement, prepend=0.0) / jnp.diff(force, prepend=0.0)
        corners = np.append(np.diff(np.asarray(slopes)) > SOFTENS * slopes[0], True)
        require("force", float(force[-1]), bool(np.sum(corners) > 1), STUCK)
        return cls.in_series(displacement[corners], force[corners], volume(scene))

    @classmethod
    def in_series(cls, displacement: Array, force: Array, volume: Array) -> Network:
        """Network of sliders in series with one backbone, for pull and push alike.

        Parameters
        ----------
        displacement, force : (k,) points of the backbone, which softens throughout
        volume : (layers,) see `Network`
        """
        slopes = jnp.diff(displacement, prepend=0.0) / jnp.diff(force, prepend=0.0)
        none = jnp.zeros((force.size - 1, force.size - 1), force.dtype)
        body = Body(
            x=none[0],
            tributary=none[0],
            K_tt=jnp.diag(1.0 / jnp.diff(slopes)),
            K_tn=none,
            K_nn=none,
            f_t=jnp.ones_like(none[0]),
            f_n=none[0],
            r_0=force[:-1],
            t_0=none[0],
            c=slopes[0],
        )
        friction = jnp.ones((), force.dtype)  # of reactions that are the sliders' limits
        return cls(body, factorise(body, friction), friction, volume)

    @property
    def rest(self) -> ContactState:
        """Contact under the pressures alone."""
        return pressed(self.body)

    @property
    def gross_slip(self) -> Array:
        """End force at which the whole strip slips, mu F_N L."""
        return self.friction * jnp.sum(self.body.r_0)

    def branch(self, start: ContactState, force: Array) -> tuple[ContactState, Array, Array]:
        """Contact, work of friction and validity after a branch from a reversal to a force."""
        branch = follow(self.body, self.factors, self.friction, start, force)
        return branch.at, branch.slip_work, branch.valid

    def sliders(self, start: ContactState, sense: Array) -> Sliders:
        """Sliders of the branch of a sense (1 or -1) that starts with a contact."""
        towards = start.force + sense
        branch = follow(self.body, self.factors, self.friction, start, towards)
        force = jnp.append(0.0, lax.cummax(branch.thresholds))  # rounding may disorder equal ones
        compliance = self.body.c + jnp.append(0.0, jnp.cumsum(branch.compliances))
        steps = compliance[:-1] * jnp.diff(force)
        return Sliders(force, jnp.append(0.0, jnp.cumsum(steps)), compliance)

    def stored(self, state: ContactState) -> Array:
        """Potential energy of a contact beyond that under the pressures alone."""
        return 0.5 * (state.v @ self.body.K_tt @ state.v + self.body.c * state.force**2)

    def cycle(self, amplitude: Array) -> tuple[Array, Array]:
        """Half the range of the displacement and work of friction in a steady cycle of force.

        Both are NaN where the slip zones are not nested.
        """
        turns = amplitude * jnp.asarray([1.0, *[-1.0, 1.0] * STEADY])
        branches = path(self.body, self.factors, self.friction, self.rest, turns)
        reach = 0.5 * jnp.abs(branches.at.displacement[-1] - branches.at.displacement[-2])
        nested = jnp.all(branches.valid)
        work = jnp.sum(branches.slip_work[-2:])
        return nan_unless(nested, (reach, work))

    def along(self, displacements: Array) -> Response:
        """Response at the points of a path (T,) of end displacements, from the pressed state."""

        def go(
            carry: tuple[Response, Response, Array], target: Array
        ) -> tuple[tuple[Response, Response, Array], Response]:
            origin, last, sense = carry
            way = jnp.sign(target - last.state.displacement)
            way = jnp.where(way == 0.0, sense, way)
            origin = jax.tree.map(lambda a, b: jnp.where(way == sense, a, b), origin, last)
            start = origin.state
            reach = jnp.abs(target - start.displacement)
            force = start.force + way * self.sliders(start, way).force_after(reach)
            end, work, valid = self.branch(start, force)
            now = Response(end, origin.slip_work + work, origin.valid & valid)
            return (origin, now, way), now

        rest = self.rest
        first = Response(rest, rest.force, jnp.asarray(True))
        return lax.scan(go, (first, first, jnp.ones_like(rest.force)), displacements)[1]
