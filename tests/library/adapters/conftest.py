"""Double precision of JAX for the tests that ask for it."""

from importlib.util import find_spec

import pytest


@pytest.fixture(scope="module")
def double_precision():
    if find_spec("jax") is None:
        yield
        return
    import jax

    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", before)
