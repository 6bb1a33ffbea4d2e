"""What a model's data have of K and its subsystem has not: a small order leaves a few per cent out, band by band."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from radiation_ss.arrays import ComplexArray, FloatArray


@dataclass(frozen=True, eq=False)
class Remainder:
    """Values (nw, n, n), symmetric, at ascending frequencies [rad/s]; between them a shape-keeping cubic, beside 0."""

    omega: FloatArray  # (nw,)
    K: ComplexArray

    @cached_property
    def _curves(self) -> PchipInterpolator:
        return PchipInterpolator(self.omega, np.stack([self.K.real, self.K.imag]), axis=1, extrapolate=False)

    @cached_property
    def _known(self) -> dict[bytes, ComplexArray]:
        return {}

    def at(self, omega: FloatArray, kept: int = 20) -> ComplexArray:
        """Return the values at frequencies [rad/s], shape (nw, n, n); those of the last few sets of them are kept."""
        key = np.asarray(omega, dtype=np.float64).tobytes()
        if key not in self._known:
            if len(self._known) >= kept:
                self._known.clear()
            real, imag = np.nan_to_num(self._curves(omega))
            self._known[key] = np.asarray(real + 1j * imag, dtype=np.complex128)
        return self._known[key]

    def part(self, dofs: list[int]) -> "Remainder":
        """Return that of some degrees of freedom."""
        return Remainder(self.omega, self.K[:, dofs][:, :, dofs])
