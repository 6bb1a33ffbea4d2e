"""Small helpers for frozen dataclasses that hold arrays."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radiation_ss.errors import InputError

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
K = TypeVar("K")
V = TypeVar("V")


def listed(given: Any) -> list[Any]:
    """Return what a collection holds; of one name, or one item that is no collection, that alone."""
    return list(given) if isinstance(given, Iterable) and not isinstance(given, str) else [given]


def distinct(names: Iterable[str], alike: Callable[[str], str] = str) -> list[str]:
    """Return names with a number added to those that are there already, by what `alike` makes of them."""
    found: dict[str, str] = {}
    for name in names:
        other, number = name, 2
        while alike(other) in found:
            other, number = f"{name}_{number}", number + 1
        found[alike(other)] = other
    return list(found.values())


def read_only(values: ArrayLike, name: str, shape: Sequence[int | None], *, dtype: type = float,
              finite: bool = True) -> NDArray:
    """Return a read-only copy of numbers of a shape, None for any size; an array that is such a one is not copied.

    `name` is the field's in messages. InputError for no numbers, another shape, or NaN and infinity where `finite`.
    """
    if isinstance(values, np.ma.MaskedArray):
        values = np.ma.filled(values.astype(dtype), np.nan)
    owned = isinstance(values, np.ndarray) and values.dtype == dtype and values.base is None
    try:
        given = np.asarray(values).dtype
        if given.kind in "mM":
            raise InputError(f"{name}: dates or times of {given} found, numbers needed (times in seconds)")
        if dtype is float and given.kind == "c":
            raise InputError(f"{name}: complex numbers found, real ones needed")
        array: NDArray = np.asarray(values) if owned else np.array(values, dtype=dtype)
        if owned and array.flags.writeable:
            array = array.copy()
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{name}: not an array of numbers ({error})") from None
    if array.ndim != len(shape) or any(want not in (None, have) for want, have in zip(shape, array.shape)):
        wanted = ", ".join("any" if want is None else str(want) for want in shape)
        raise InputError(f"{name}: shape {array.shape} found, ({wanted}) needed")
    if finite and not np.isfinite(array).all():
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(f"{name}: value {array[first]} at index {first} is not finite")
    array.setflags(write=False)
    return array


def positive(value: Any, name: str, unit: str = "", *, or_infinite: bool = False) -> float:
    """Return a positive, finite number (or infinity, if allowed); InputError with its name and unit if it is none."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name}: {value!r} is not a number") from None
    if not (0.0 < number < np.inf or (or_infinite and number == np.inf)):
        raise InputError(f"{name}: must be positive{', or inf' if or_infinite else ' and finite'}, found "
                         f"{number:g} {unit}".rstrip())
    return number


def generator(seed: int | np.random.Generator) -> np.random.Generator:
    """Return the random generator of a seed, a whole number from 0 on."""
    try:
        return np.random.default_rng(seed)
    except (TypeError, ValueError):
        raise InputError(f"seed: {seed!r}; a whole number, 0 or more, is needed") from None


def is_number(value: Any, *, whole: bool = False) -> bool:
    """Return whether something is one real number, NaN and infinity among them; a truth value is none.

    >>> is_number(np.float32(0.5)), is_number(True), is_number("1"), is_number(2.0, whole=True)
    (True, False, False, False)
    """
    kinds = (int, np.integer) if whole else (int, float, np.integer, np.floating)
    return isinstance(value, kinds) and not isinstance(value, bool)


def check_height(value: Any, name: str) -> None:
    """Refuse what is not one finite number, the height of a point.

    >>> check_height(-0.5, "centre_of_gravity")
    """
    if not is_number(value) or not np.isfinite(value):
        raise InputError(f"{name}: {value!r}; one number is needed, the height above the still water surface [m]")


def frequencies(count: int) -> str:
    """Return a number of frequencies in words.

    >>> frequencies(1), frequencies(2)
    ('1 frequency', '2 frequencies')
    """
    return f"{count} frequency" if count == 1 else f"{count} frequencies"


def check_numbers(settings: object, table: Iterable[tuple[str, Callable[[Any], bool], str]]) -> None:
    """Raise InputError for a field of settings that is no number, or not one as needed.

    `table`: names of fields, with a space between, whether a value of theirs is good, and what is needed.
    """
    for names, good, needed in table:
        for name in names.split():
            value = getattr(settings, name)
            if not is_number(value) or not good(value):
                raise InputError(f"{name}: {value!r}; {needed}")


class FrozenMap(Mapping[K, V]):
    """A mapping that cannot be changed and can be pickled, for fields of frozen dataclasses."""

    __slots__ = ("_items",)

    def __init__(self, items: Mapping[K, V] | Iterable[tuple[K, V]] = ()) -> None:
        self._items = dict(items)

    def __getitem__(self, key: K) -> V:
        return self._items[key]

    def __iter__(self) -> Iterator[K]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __repr__(self) -> str:
        return repr(self._items)


def lagrange(nodes: FloatArray, at: ArrayLike) -> FloatArray:
    """Return the weights of values at some nodes (..., k) in their polynomial at other places (...), shape (..., k)."""
    others = ~np.eye(np.shape(nodes)[-1], dtype=bool)
    above = np.where(others, np.asarray(at)[..., None, None] - np.asarray(nodes)[..., None, :], 1.0)
    below = np.where(others, np.asarray(nodes)[..., :, None] - np.asarray(nodes)[..., None, :], 1.0)
    return np.asarray(np.prod(above, axis=-1) / np.prod(below, axis=-1))


def couples(inertia: FloatArray, others: Iterable[tuple[FloatArray | None, float | FloatArray]], least: float,
            noise: float = 1e-3) -> NDArray[np.bool_]:
    """Return whether a body's matrices couple two motions by `least` of the geometric mean of both diagonals, (n, n).

    Each of the others comes with what inertias are multiplied by to be like it: frequencies or their squares, one or
    (n,). Its diagonal counts as a share `noise` of that at least: that of a motion that does not radiate, or that
    nothing restores, is rounding.
    """
    own = inertia.diagonal()
    sizes = [(np.abs(m), np.maximum(np.abs(m.diagonal()), noise * own * scale)) for m, scale in others if m is not None]
    linked = [m > least * np.sqrt(np.outer(size, size)) for m, size in ((np.abs(inertia), own), *sizes)]
    return np.asarray(np.any(linked, axis=0) | np.any(linked, axis=0).T)


def reached(linked: NDArray[np.bool_], first: Sequence[int]) -> list[int]:
    """Return the rows that links (n, n) join to the first ones, step by step, and those, in order."""
    whole = np.linalg.matrix_power(np.asarray(linked | np.eye(len(linked), dtype=bool), dtype=int), len(linked))
    return [int(i) for i in np.flatnonzero(whole[list(first)].any(axis=0))]
