"""Failures: which exception, its message, code and fields."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import mechid
from mechid._errors import _read

from .test_codes import listed

FILE = "examples/machine.csv"
ONE = np.arange(64.0)


def test_the_message_is_that_of_the_program(program: Callable[..., str]) -> None:
    with pytest.raises(mechid.MechidError) as caught:
        mechid.identify(FILE, force="force", displacement="displacement", period=600)
    told = program(
        "identify", FILE, "--force", "force", "--displacement", "displacement", "--period", 600, code=2
    )
    spelled = str(caught.value)
    for name in ("start", "period", "periods"):
        spelled = spelled.replace(f"`{name}`", f"--{name}")
    assert told == f"error: {spelled}\n"
    assert isinstance(caught.value, ValueError)
    assert caught.value.code == "analysis.window"
    assert caught.value.fields == {"file": FILE, "first": 1, "last": 600, "len": 512}


@pytest.mark.parametrize(
    ("call", "code"),
    [
        (lambda: mechid.identify("missing.csv", force="f", displacement="x"), "io.read"),
        (lambda: mechid.identify(FILE, force="load", displacement="displacement"), "io.missing-column"),
        (lambda: mechid.identify(ONE, ONE * np.nan, fs=1), "signal.not-finite"),
        (lambda: mechid.identify(ONE, ONE[:3], fs=1), "analysis.array-shape"),
        (lambda: mechid.identify(ONE, ONE, fs=-1), "signal.not-positive"),
        (lambda: mechid.identify(ONE * 0, ONE, fs=1), "analysis.zero-force"),
        (lambda: mechid.identify(ONE, fs=1), "analysis.no-motion"),
        (lambda: mechid.identify(ONE, ONE, fs=1, lines="1:x"), "settings"),
        (lambda: mechid.identify(ONE, ONE, fs=1, method="guess"), "settings"),
        (lambda: mechid.identify(ONE, ONE, fs=1, domain="time"), "analysis.time-domain-motions"),
        (lambda: mechid.Machine([[0.0]], [[1.0]], [[1.0]]), "model.singular-mass"),
        (lambda: mechid.identify({"f": ONE}, force="f", displacement="x", fs=1), "analysis.no-column"),
    ],
)
def test_failures_have_codes(call: Callable[[], Any], code: str) -> None:
    with pytest.raises(mechid.MechidError) as caught:
        call()
    assert caught.value.code == code, str(caught.value)
    assert code in listed()
    assert len(str(caught.value)) > 15


@pytest.mark.parametrize(
    ("call", "exception", "words"),
    [
        (lambda: mechid.identify(ONE * 1j, ONE, fs=1), TypeError, "`force` holds complex128"),
        (lambda: mechid.identify(ONE, ["a"] * 64, fs=1), TypeError, "`displacement` holds <U1"),
        (lambda: mechid.identify(ONE, ONE > 3, fs=1), TypeError, "`displacement` holds bool"),
        (lambda: mechid.identify(ONE, np.zeros((2, 2, 2)), fs=1), ValueError, "got 2×2×2"),
        (lambda: mechid.identify(3.0, ONE, fs=1), ValueError, "no dimension"),
        (lambda: mechid.identify(ONE, ONE), TypeError, "sampling rate"),
        (lambda: mechid.identify(ONE, ONE, ONE, fs=1), TypeError, "got 3"),
        (lambda: mechid.identify(ONE, ONE, displacement=ONE, fs=1), TypeError, "given twice"),
        (lambda: mechid.identify(ONE, ONE, fs=1, period=0), ValueError, "counted from 1"),
        (lambda: mechid.identify(ONE, ONE, fs=1, period=2.5), TypeError, "whole number"),
        (lambda: mechid.identify(ONE, ONE, fs=1, skip_lines=2), TypeError, "applies only to files"),
        (lambda: mechid.identify({"f": ONE, "x": ONE}, fs=1, skip_lines=2), TypeError, "applies only to files"),
        (lambda: mechid.identify(ONE, ONE, fs=1, unit={"force": "kN"}), TypeError, "`unit` belongs to files and tables"),
        (lambda: mechid.identify(ONE, ONE, time="t"), TypeError, "`time` belongs to files and tables"),
        (lambda: mechid.identify(ONE, ONE, fs=1, derivatives="spectral"), mechid.MechidError, "domain` time"),
        (lambda: mechid.identify(ONE, ONE, fs=1, segment=8), mechid.MechidError, "from_frf"),
        (
            lambda: mechid.identify(np.ma.masked_less(ONE, 3), ONE, fs=1),
            ValueError,
            "masked",
        ),
    ],
)
def test_wrong_arguments_are_refused(
    call: Callable[[], Any], exception: type[Exception], words: str
) -> None:
    with pytest.raises(exception, match=words):
        call()


def test_an_error_survives_pickling() -> None:
    with pytest.raises(mechid.MechidError) as caught:
        mechid.identify(ONE * 0, ONE, fs=1)
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.code, again.fields) == (
        str(caught.value),
        caught.value.code,
        caught.value.fields,
    )


@pytest.mark.parametrize(
    ("variant", "names", "fields"),
    [
        ("NoRecord", ["NoRecord"], {}),
        ("Io(Read { file: \"a, {b\", n: -1.5e-7 })", ["Io", "Read"], {"file": "a, {b", "n": -1.5e-7}),
        ('X { a: "q\\"\\u{e9}\\n", b: [1, 2], c: Some(3), d: None }', ["X"],
         {"a": 'q"é\n', "b": [1, 2], "c": 3, "d": None}),
        ("X { a: Displacement, b: inf, c: true }", ["X"], {"a": "displacement", "b": float("inf"), "c": True}),
        ("X { unbalanced: [", ["X"], {}),
    ],
)
def test_variants_are_read(variant: str, names: list[str], fields: dict[str, object]) -> None:
    assert _read(variant) == (names, fields)
