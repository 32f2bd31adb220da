"""Settings of the whole test run."""

import os

import hypothesis
import jax

os.environ["MPLBACKEND"] = "Agg"  # children of the tests inherit it
jax.config.update("jax_enable_x64", True)

hypothesis.settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=50)
hypothesis.settings.load_profile("repeatable")
