"""Small helpers for frozen dataclasses that hold arrays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radiation_ss.errors import InputError

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def read_only(values: ArrayLike, name: str, shape: Sequence[int | None], *, dtype: type = float,
              finite: bool = True) -> NDArray:
    """Return a read-only copy of `values` of the given shape.

    Parameters
    ----------
    values : array_like
    name : str
        The field's name, used in error messages.
    shape : sequence of int or None
        Required shape; None leaves a dimension free.
    dtype : type
        float or complex.
    finite : bool
        Refuse NaN and infinity.

    Raises
    ------
    InputError
        If the values are not numbers, have another shape or are not finite.
    """
    try:
        array: NDArray = np.array(values, dtype=dtype)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: not an array of numbers ({error})") from None
    if array.ndim != len(shape) or any(want not in (None, have) for want, have in zip(shape, array.shape)):
        wanted = ", ".join("any" if want is None else str(want) for want in shape)
        raise InputError(f"{name}: shape {array.shape} found, ({wanted}) needed")
    if finite and not np.isfinite(array).all():
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(f"{name}: value {array[first]} at index {first} is not finite")
    array.setflags(write=False)
    return array
