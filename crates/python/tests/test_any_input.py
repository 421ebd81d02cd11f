"""Any input gives a result or an exception with a reason, and no call leaks memory.

``MECHID_CASES`` sets the number of inputs and calls; the check of every change tries a few.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import mechid

CASES = int(os.environ.get("MECHID_CASES", "300"))
DTYPES = ["f2", "f4", "f8", ">f8", "g", "i1", "i8", "u2", "c16", "?", "U3", "O", "M8[s]"]


@st.composite
def arrays(draw: st.DrawFn) -> Any:
    """An array of any type, shape and layout; half of the arrays are valid."""
    length = draw(st.integers(0, 40))
    good = draw(st.booleans())
    shape = (length,) if good else tuple(draw(st.lists(st.integers(0, 5), max_size=3)))
    dtype = np.dtype("f8" if good else draw(st.sampled_from(DTYPES)))
    seed = draw(st.integers(0, 2**32 - 1))
    values: Any = np.random.default_rng(seed).standard_normal(shape)
    if draw(st.integers(0, 4)) == 0:
        values = values * 10.0 ** draw(st.sampled_from([-320, -200, 0, 150, 307]))
    with np.errstate(all="ignore"):
        # Arrays without a dimension are converted to numbers.
        values = np.asarray(values).astype(dtype) if dtype.kind != "M" else np.zeros(shape, dtype)
    values = np.asarray(values)
    if draw(st.integers(0, 9)) == 0 and values.size and values.dtype.kind == "f":
        values = np.array(values)
        values.flat[0] = draw(st.sampled_from([np.nan, np.inf, -np.inf]))
    layout = draw(st.integers(0, 3))
    if layout == 1 and values.ndim:
        return values[::-1]
    if layout == 2:
        return values.T
    if layout == 3:
        return values.tolist()
    return values


@st.composite
def options(draw: st.DrawFn) -> dict[str, Any]:
    some = {
        "method": st.sampled_from(["least-squares", "instrumental", "maximum-likelihood", "x"]),
        "period": st.integers(-1, 20),
        "periods": st.integers(0, 4),
        "start": st.integers(-2, 50),
        "lines": st.sampled_from(["all", "odd", "1:3", "99", "", "1:0:2"]),
        "band_hz": st.tuples(st.floats(), st.floats()),
        "mass": st.one_of(st.floats(), st.lists(st.one_of(st.none(), st.floats()), max_size=5)),
        "from_frf": st.sampled_from(["h1", "h2", "hv"]),
        "segment": st.integers(-1, 50),
        "refine": st.sampled_from(["8:linear", "0:linear", 3, {"factor": 2}]),
        "domain": st.sampled_from(["time", "frequency"]),
        "between_samples": st.sampled_from(["euler", "held", "linear"]),
        "extent": st.sampled_from(["open", "period"]),
        "derivatives": st.sampled_from(["spectral", "savitzky-golay:5:3", "savitzky-golay:4:9", "a"]),
        "fs": st.floats(),
    }
    names = draw(st.lists(st.sampled_from(sorted(some)), unique=True, max_size=4))
    return {"fs": 100.0, **{name: draw(some[name]) for name in names}}


@settings(
    max_examples=CASES, deadline=None, derandomize=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
@given(arrays(), arrays(), st.one_of(st.none(), arrays()), options())
@pytest.mark.filterwarnings("ignore")
def test_no_input_ends_the_interpreter(force: Any, x: Any, v: Any, how: dict[str, Any]) -> None:
    given = {} if v is None else {"velocity": v}
    try:
        found = mechid.identify(force, x, **given, **how)
    except mechid.MechidError as error:
        assert error.code not in ("internal", ""), str(error)
    except (TypeError, ValueError) as error:
        assert str(error)
    else:
        assert found.to_dict()["parameters"]


def resident() -> int:
    """Bytes of memory of this process that are in use."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        pytest.skip("this system does not tell how much memory is in use")


def test_nothing_leaks() -> None:
    rng = np.random.default_rng(1)
    force, x = rng.standard_normal((2, 512))

    def call() -> None:
        found = mechid.identify(force, x, fs=100.0, period=256)
        assert found.parameters and found.to_json() and found.covariance.shape == (3, 3)
        with pytest.raises(mechid.MechidError):
            mechid.identify(force, x * 0, fs=100.0, period=999)

    for _ in range(200):
        call()
    before = resident()
    for _ in range(CASES):
        call()
    # A leak of one array per call would be 4 kB per call.
    assert resident() - before < 2**20 + 1024 * CASES
