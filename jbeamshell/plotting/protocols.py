"""Protocols of the results that can be drawn.

Each lists the attributes that its pictures read, with their shapes, so that pictures know no
class of results and any object with these attributes can be drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from jax import Array
from numpy.typing import ArrayLike

from jbeamshell.scene.scene import Scene


class LoopPath(Protocol):
    """Force over displacement, step by step, (steps+1,) each.

    Attributes
    ----------
    force, displacement : load, and the displacement conjugate to it
    cycles : steps at the start, the turn and the end of each closed cycle
    loop : force and displacement of the last closed cycle, (k,) each
    """

    @property
    def force(self) -> Array: ...
    @property
    def displacement(self) -> Array: ...
    @property
    def cycles(self) -> Sequence[tuple[int, int, int]]: ...
    @property
    def loop(self) -> tuple[Array, Array]: ...


class ContactPath(LoopPath, Protocol):
    """Contact between substructures, step by step, such as a `jbeamshell.ContactHistory`.

    Attributes
    ----------
    x : (n,) places of the contact nodes
    slip, gap, traction, reaction : (steps+1, n) tangential displacement, height, friction traction
        and normal reaction
    slipping, touching : (steps+1, n) True where a node slips, or is in contact
    """

    @property
    def x(self) -> Array: ...
    @property
    def touching(self) -> Array: ...
    @property
    def slip(self) -> Array: ...
    @property
    def gap(self) -> Array: ...
    @property
    def traction(self) -> Array: ...
    @property
    def reaction(self) -> Array: ...
    @property
    def slipping(self) -> Array: ...


class LoadPath(LoopPath, Protocol):
    """Solved load path, step by step, such as a `jbeamshell.History`.

    Pictures along X also read the profiles ``gap``, ``beta``, ``psi``, ``squeeze_stress`` and
    ``squeeze_couple``, (steps+1, n) or (steps+1, elements), as far as the scene has them.

    Attributes
    ----------
    scene : the scene that was solved
    x, tributary : (n,) positions of the nodes and their contact lengths
    middles : (elements,) middles of the elements
    pressed : first step at which the whole pressure acts
    pressure : (steps+1,) part of the pressures that acts
    fields : (steps+1, n, m) v, w, beta, psi, ... of the strip
    member : likewise of the second member of a lap joint; None without one
    slip, beta, psi : (steps+1, n) slip since the pressing, rotation, squeeze strain
    traction, reaction : (steps+1, n) friction traction and normal reaction
    slipping, touching : (steps+1, n) True where a node slips, or touches the foundation
    contact_end : (steps+1,) position X at which the contact ends
    """

    @property
    def scene(self) -> Scene: ...
    @property
    def x(self) -> Array: ...
    @property
    def tributary(self) -> Array: ...
    @property
    def middles(self) -> Array: ...
    @property
    def pressed(self) -> int: ...
    @property
    def pressure(self) -> Array: ...
    @property
    def fields(self) -> Array: ...
    @property
    def member(self) -> Array | None: ...
    @property
    def slip(self) -> Array: ...
    @property
    def beta(self) -> Array: ...
    @property
    def psi(self) -> Array: ...
    @property
    def traction(self) -> Array: ...
    @property
    def reaction(self) -> Array: ...
    @property
    def slipping(self) -> Array: ...
    @property
    def touching(self) -> Array: ...
    @property
    def contact_end(self) -> Array: ...


class Vibration(Protocol):
    """Transient motion, such as a `jbeamshell.dynamics.Motion`, (T,) each; energies are per width.

    Attributes
    ----------
    time : instants, evenly spaced
    displacement, velocity : end displacement u(L) and its rate
    kinetic, stored : energies
    external_work, friction_work, damping_work : work since t = 0, done from outside, and lost by
        friction and by damping
    """

    @property
    def time(self) -> ArrayLike: ...
    @property
    def displacement(self) -> ArrayLike: ...
    @property
    def velocity(self) -> ArrayLike: ...
    @property
    def kinetic(self) -> ArrayLike: ...
    @property
    def stored(self) -> ArrayLike: ...
    @property
    def external_work(self) -> ArrayLike: ...
    @property
    def friction_work(self) -> ArrayLike: ...
    @property
    def damping_work(self) -> ArrayLike: ...


class ModalProperties(Protocol):
    """Frequency and damping ratio over amplitude, (k,) each."""

    @property
    def amplitude(self) -> np.ndarray: ...
    @property
    def frequency(self) -> np.ndarray: ...
    @property
    def damping(self) -> np.ndarray: ...


class ResponseCurve(Protocol):
    """Steady responses along a curve of k points.

    Attributes
    ----------
    frequency : (k,) frequency of the force
    harmonics, harmonic_amplitudes : (H,) numbers of the harmonics, and their (k, H) amplitudes
    """

    @property
    def frequency(self) -> np.ndarray: ...
    @property
    def harmonics(self) -> np.ndarray: ...
    @property
    def harmonic_amplitudes(self) -> np.ndarray: ...


class RingDownComparison(Protocol):
    """Ring-down beside its quasi-static prediction.

    Attributes
    ----------
    motion : the transient
    found : its frequency and damping over the amplitude of u(L)
    predicted : frequency and damping over the modal amplitude
    payload : mass per width, whose root turns modal amplitudes into those of u(L)
    """

    @property
    def motion(self) -> Vibration: ...
    @property
    def found(self) -> ModalProperties: ...
    @property
    def predicted(self) -> ModalProperties: ...
    @property
    def payload(self) -> float: ...


class ModelOverData(Protocol):
    """Measurements beside what a fitted model answers, such as `jbeamshell.identify.Fit`.

    Attributes
    ----------
    data, model : the measurements, and the model's at the same points
    columns : name of the column that the model answers, of each measurement
    residuals : (points,) model less data over the range of the data, of each measurement
    problem : what was solved; None if the result cannot tell its confidence bands
    """

    @property
    def data(self) -> Sequence[Any]: ...
    @property
    def model(self) -> Sequence[Any]: ...
    @property
    def columns(self) -> Sequence[str]: ...
    @property
    def residuals(self) -> Sequence[np.ndarray]: ...
    @property
    def problem(self) -> object: ...
    def bands(self, level: float, /) -> Sequence[tuple[Any, Any]]: ...


class InspectedRecording(Protocol):
    """Recording with its cycles and what was found, such as a view of a `jbeamshell.Inspection`.

    Attributes
    ----------
    recording : force, displacement and time with their units
    levels : mean loop, number of cycles and shape of each amplitude
    findings : what is wrong or doubtful: a name, and whether it is grave
    """

    @property
    def recording(self) -> Any: ...
    @property
    def levels(self) -> Sequence[Any]: ...
    @property
    def findings(self) -> Sequence[Any]: ...


class InspectedData(Protocol):
    """Recordings that were looked at, such as a `jbeamshell.Inspection`.

    Attributes
    ----------
    views : what each recording holds
    """

    @property
    def views(self) -> Sequence[InspectedRecording]: ...


class LikelihoodProfile(Protocol):
    """Profile likelihood of one parameter, such as `Fit.profile` of `jbeamshell.identify` gives.

    Attributes
    ----------
    name : key of the parameter
    values : (points,) its values, increasing
    rises : (points,) rises of the cost, in units of the noise squared
    interval : ends of its confidence interval
    level : level of confidence
    """

    @property
    def name(self) -> str: ...
    @property
    def values(self) -> np.ndarray: ...
    @property
    def rises(self) -> np.ndarray: ...
    @property
    def interval(self) -> tuple[float, float]: ...
    @property
    def level(self) -> float: ...


class ComparedModel(Protocol):
    """One model of a comparison.

    Attributes
    ----------
    name : name of the model
    fit : None for the target itself, or where there is no fit
    energy : (n,) energy per cycle at the target's amplitudes
    numbers : count of fitted numbers
    seconds : time of one response
    """

    @property
    def name(self) -> str: ...
    @property
    def fit(self) -> object: ...
    @property
    def energy(self) -> np.ndarray: ...
    @property
    def numbers(self) -> int: ...
    @property
    def seconds(self) -> float: ...


class ComparedModels(Protocol):
    """Models fitted to one target, such as `jbeamshell.identify.compare` gives.

    Attributes
    ----------
    amplitude, energy : (n,) amplitudes and energies of the target's steady cycles
    drive : column of the amplitudes, "force" or "displacement"
    rows : the models
    """

    @property
    def amplitude(self) -> np.ndarray: ...
    @property
    def energy(self) -> np.ndarray: ...
    @property
    def drive(self) -> str: ...
    @property
    def rows(self) -> Sequence[ComparedModel]: ...

    def error(self, row: Any) -> np.ndarray:
        """Relative error (n,) of a model's energies."""
        ...
