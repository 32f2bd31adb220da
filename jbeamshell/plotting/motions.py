"""Pictures of motions: displacement, energies, frequency and damping, spectrogram."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jbeamshell.plotting.style import (
    DATA,
    DISPLACEMENT,
    PALETTE,
    mark_decades,
    panels,
    remark,
    single,
    style,
)
from jbeamshell.scene.mounting import in_words

TIME = "$t$  [time]"
AMPLITUDE, OF_STRIP = "amplitude  [length]", "amplitude of $u(L)$  [length]"
MODAL = r"modal displacement $q$  [length $\sqrt{\mathrm{mass}}$]"
FREQUENCY, DAMPING = "frequency  [1/time]", r"damping ratio $\zeta$  [dimensionless]"
LEDGER = {
    "kinetic": "kinetic",
    "stored": "stored",
    "friction_work": "friction",
    "damping_work": "damping",
}
WINDOWS = 12  # windows of a spectrogram, side by side
FLOOR = -70.0  # dB, the darkest shade of a spectrogram
HARMONICS = 8.5  # multiples of the main frequency up to which a spectrogram goes


def vibration(motion: Any, axes: Axes | None = None) -> Axes:
    """Draw u(L) of a `jbeamshell.dynamics.Motion` over time."""
    with style():
        axes = single(axes)
        axes.plot(motion.time, motion.displacement, color=PALETTE[0], linewidth=1.0)
        axes.set(xlabel=TIME, ylabel=DISPLACEMENT)
    return axes


def energies(motion: Any, axes: Axes | None = None) -> Axes:
    """Draw kinetic energy, stored energy and the losses over time, one on top of the other.

    Parameters
    ----------
    motion : jbeamshell.dynamics.Motion
        Transient of a strip.
    axes : matplotlib.axes.Axes, optional
        Where to draw; new axes when not given.

    Notes
    -----
    Stored energy is counted from its least value. The dashed line is the energy at the start plus
    the work done from outside since.
    """
    with style():
        axes = single(axes)
        least = float(np.nanmin(np.asarray(motion.stored)))
        parts = {name: np.asarray(getattr(motion, name)) for name in LEDGER}
        parts["stored"] = parts["stored"] - least
        if not np.any(parts["damping_work"] > 0.0):
            del parts["damping_work"]
        time = np.asarray(motion.time)
        axes.stackplot(
            time,
            list(parts.values()),
            labels=[LEDGER[name] for name in parts],
            colors=[PALETTE[0], PALETTE[5], PALETTE[1], PALETTE[4]],
            linewidth=0.6,
            edgecolor="white",
        )
        whole = parts["kinetic"][0] + parts["stored"][0] + np.asarray(motion.external_work)
        axes.plot(time, whole, color=DATA, linestyle="--", linewidth=1.0, label="supplied")
        axes.set(xlabel=TIME, ylabel="energy  [force]")
        axes.legend(loc="center right", frameon=True, framealpha=0.9)
    return axes


def ring_down(found: Any, *, label: str = "ring-down", axes: Sequence[Axes] | None = None) -> Any:
    """Draw frequency and damping over amplitude on two axes.

    Parameters
    ----------
    found : result of `jbeamshell.dynamics.ring_down`
    label : words of the legend
    axes : two axes; a new figure when not given
    """
    columns = found.amplitude, found.frequency, found.damping
    return _pair(columns, axes, label, "o", DATA, AMPLITUDE)


def modal_curve(
    curve: Any,
    *,
    mass: float | None = None,
    label: str = "quasi-static",
    axes: Sequence[Axes] | None = None,
) -> Any:
    """Draw frequency and damping over amplitude on two axes.

    Parameters
    ----------
    curve : result of `jbeamshell.dynamics.modal_curve` or `nonlinear_mode`
    mass : mass whose root divides the modal displacements, to give those drawn; None draws modal
        displacements
    label : words of the legend
    axes : two axes; a new figure when not given
    """
    amplitude = np.asarray(curve.amplitude) / np.sqrt(1.0 if mass is None else mass)
    columns = amplitude, np.asarray(curve.frequency), np.asarray(curve.damping)
    along = MODAL if mass is None else AMPLITUDE
    return _pair(columns, axes, label, "", PALETTE[1], along)


def spectrogram(motion: Any, axes: Axes | None = None) -> Axes:
    """Draw the spectrum of a motion's velocity over time, in dB of its largest value."""
    import scipy.signal  # takes longer to import than other pictures take to draw

    time, velocity = np.asarray(motion.time), np.asarray(motion.velocity)
    length = max(16, 2 * time.size // WINDOWS)
    frequency, at, power = scipy.signal.spectrogram(
        velocity,
        1.0 / (time[1] - time[0]),
        nperseg=length,
        noverlap=(7 * length) // 8,
        window="hann",
    )
    level = 10.0 * np.log10(np.maximum(power / power.max(), 1e-30))
    with style():
        axes = single(axes)
        shown = axes.pcolormesh(
            at, frequency, level, vmin=FLOOR, vmax=0.0, cmap="magma", shading="auto"
        )
        axes.figure.colorbar(shown, ax=axes, label="power of the velocity  [dB]")
        axes.grid(False)
        main = frequency[np.argmax(power.sum(axis=1))]
        axes.set(xlabel=TIME, ylabel=FREQUENCY)
        axes.set_ylim(0.0, min(HARMONICS * main, frequency[-1]))
    return axes


def ring_down_sheet(study: Any) -> Figure:
    """Draw motion, energies, frequency and damping of a ring-down, beside the prediction.

    Parameters
    ----------
    study : result of `jbeamshell.dynamics.let_go`
    """
    with style():
        axes = panels(2, 2)
        vibration(study.motion, axes[0, 0])
        energies(study.motion, axes[0, 1])
        ring_down(study.found, axes=axes[1])
        modal_curve(study.predicted, mass=study.payload, axes=axes[1])
        reach = np.asarray(study.found.amplitude)
        for below, values in zip(
            axes[1], (study.found.frequency, study.found.damping), strict=True
        ):
            known = values[values > 0.0]
            room = (known.max() / known.min()) ** 0.1
            below.set_xlim(0.9 * reach.min(), 1.1 * reach.max())
            below.set_xlabel(OF_STRIP)
            mark_decades(below.xaxis)
            below.set_ylim(known.min() / room, known.max() * room)
        mark_decades(axes[1, 1].yaxis)
        remark(axes[0, 0].figure, in_words(study.motion.scene))
    return axes[0, 0].figure


def _pair(
    columns: tuple[Any, Any, Any],
    axes: Sequence[Axes] | None,
    label: str,
    marker: str,
    colour: str,
    along: str,
) -> Any:
    """Draw frequency and damping over amplitude on two axes."""
    amplitude, frequency, damping = map(np.asarray, columns)
    line: dict[str, Any] = {"color": colour, "marker": marker, "markersize": 3.0, "label": label}
    line["linestyle"] = "" if marker else "-"
    with style():
        pair = panels(1, 2)[0] if axes is None else axes
        pair[0].plot(amplitude, frequency, **line)
        shown = damping > 0.0
        pair[1].plot(amplitude[shown], damping[shown], **line)
        pair[0].set(xlabel=along, ylabel=FREQUENCY, xscale="log")
        pair[1].set(xlabel=along, ylabel=DAMPING, xscale="log", yscale="log")
        pair[1].legend(loc="upper left")
        mark_decades(pair[0].xaxis, pair[1].xaxis, pair[1].yaxis)
    return pair
