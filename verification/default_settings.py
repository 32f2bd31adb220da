"""Error and cost of the settings that a scene chooses for itself, over its tolerance.

    python calibration/default_settings.py [--scenes 100]

solves plain random scenes for several tolerances, as they are and with the same model on a mesh
twice as fine, and writes default_settings.json beside this file.  The errors are those of the
dissipation and of the loop (largest difference of the response over its range).
`jbeamshell.scene.planning` takes its numbers from here and from calibration/campaign.py, which has
scenes of all kinds; calibration/charts/settings.py draws both records.
"""

import argparse
import json
import time
import warnings
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from campaign import Row, finer, loop_error, off  # noqa: E402
from provenance import provenance  # noqa: E402
from random_scenes import Values, plain  # noqa: E402
from tqdm import tqdm  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402

RECORD = Path(__file__).parent / "default_settings.json"
SEED = 20
TOLERANCES = (0.02, 0.01, 0.005, 0.0025)


def compared(values: Values) -> Row:
    """Errors and time of one scene."""
    scene = jb.library.standard().replace(values)
    jb.solve(scene, throw=False)
    begun = time.perf_counter()
    found = jax.block_until_ready(jb.solve(scene, throw=False))
    took = time.perf_counter() - begun
    fine = jb.solve(finer(found.scene), throw=False)
    return {
        "dissipation": off(float(found.dissipation), float(fine.dissipation)),
        "loop": loop_error(found, fine),
        "converged": found.converged and fine.converged,
        "ms": 1e3 * took,
    }


def of_all_tolerances(scenes: int) -> list[Row]:
    """Rows of plain scenes, the same for each tolerance."""
    rows = []
    for tolerance in TOLERANCES:
        random = np.random.default_rng(SEED)
        for _ in tqdm(range(scenes), f"tolerance {tolerance:g}"):
            rows.append(
                {"tolerance": tolerance} | compared(plain(random) | {"model.tolerance": tolerance})
            )
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=100, help="scenes for each tolerance")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", jb.DoubtfulWarning)
        rows = of_all_tolerances(parser.parse_args().scenes)
    record = {"about": provenance(), "seed": SEED, "tolerances": rows}
    write_text(RECORD, json.dumps(record, indent=1))
