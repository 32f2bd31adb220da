"""Errors of plane elasticity's dissipation over its contact nodes.

    python calibration/condensed_nodes.py

writes condensed_nodes.json beside this file: for every number of nodes the worst error against the
converged finite elements of calibration/data/energy.csv, in percent, where D exceeds a tenth of the
bar's cubic law and down to a ten-thousandth; with the edge of the slip zone followed through the
elements, as `jb.contact_line.dissipation` does, and with the nodes' own thresholds, as histories
have them.  The numbers of nodes that the package takes unasked come from here.
"""

import csv
import json
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402
from provenance import provenance  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.contact_line import branches, cycles, strip  # noqa: E402
from jbeamshell.contact_line.body import Body  # noqa: E402

HERE = Path(__file__).parent
COUNTS = (17, 25, 33, 49, 65, 89, 129)
TURNS = jnp.asarray([1.0, -1.0, 1.0, -1.0, 1.0])


def both(body: Body, friction: jax.Array, amplitudes: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Dissipation with the zone's edge followed, and with the nodes' own thresholds."""
    factors = branches.factorise(body, friction)

    def one(amplitude: jax.Array) -> jax.Array:
        start = branches.pressed(body)
        path = branches.path(body, factors, friction, start, amplitude * TURNS)
        return jnp.sum(path.slip_work[-2:])

    followed = cycles.cycle_factors(body, friction).dissipation(amplitudes)
    return followed, jax.vmap(one)(amplitudes)


def study() -> list[dict[str, float]]:
    """Worst errors in percent, a row for each number of nodes."""
    with (HERE / "data" / "energy.csv").open(encoding="utf-8") as file:
        table = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    rows = []
    for nodes in COUNTS:

        @jax.jit
        def works(eta: jax.Array, sizes: jax.Array, nodes: int = nodes) -> tuple[jax.Array, ...]:
            scene = jb.library.standard().replace({"strip.height_ratio": eta})
            return both(strip.condensed(scene, nodes).body, scene.contact.friction, sizes)

        worst: dict[str, float] = {}
        for eta in sorted({row["eta"] for row in table}):
            own = [row for row in table if row["eta"] == eta]
            found = works(jnp.asarray(eta), jnp.asarray([row["A"] for row in own]))
            for name, values in zip(("followed", "own"), found, strict=True):
                for row, value in zip(own, values, strict=True):
                    if row["ratio"] > 1e-4:
                        key = f"{name}, D > {'0.1' if row['ratio'] > 0.1 else '1e-4'}"
                        off = 100.0 * abs(float(value) / row["D"] - 1.0)
                        worst[key] = round(max(worst.get(key, 0.0), off), 3)
        rows.append({"nodes": nodes} | worst)
        print(rows[-1], flush=True)
    return rows


def main() -> None:
    """Write the record."""
    grid = {
        "end_size_over_H": strip.PLANE_END_SIZE,
        "growth": strip.PLANE_GROWTH,
        "far_size_over_L": strip.PLANE_FAR_SIZE,
    }
    record = {"about": provenance(), "grid": grid, "errors_in_percent": study()}
    write_text(HERE / "condensed_nodes.json", json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()
