"""The package's own errors: one clear sentence each."""


class RadiationError(Exception):
    """Base class of every error that the package raises on purpose.

    What a file holds can be long: the middle of a message of more than `longest` characters is left out.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> try:
    ...     rss.lewis_section(half_breadth=-0.1, draft=0.1, area_ratio=0.9)
    ... except rss.RadiationError as error:
    ...     print(type(error).__name__)
    InputError
    """

    def __init__(self, message: object = "", longest: int = 800) -> None:
        text, half = " ".join(str(message).splitlines()), longest // 2
        super().__init__(text if len(text) <= longest else f"{text[:half]} ... {text[-half:]}")


class InputError(RadiationError, ValueError):
    """Bad input. The message names file, line, field and unit as far as they exist, and what would be right.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> try:
    ...     rss.read_hydro("absent.nc")
    ... except rss.InputError as error:
    ...     print(error)
    absent.nc: no such file or folder
    """


class SolverError(RadiationError, RuntimeError):
    """A numerical method did not reach its goal; no last iterate is returned in its place.

    Examples
    --------
    A motion that grows without bounds:

    >>> import numpy as np
    >>> import radiation_ss as rss
    >>> model = rss.body(dof="Heave", mass=1.0, added_mass=0.0, C=1.0)
    >>> push = (np.linspace(0.0, 2000.0, 2001), np.ones((1, 2001)))
    >>> try:
    ...     rss.simulate(model, push, [("linear_damping", "Heave", {"coefficient": -0.9})])
    ... except rss.SolverError as error:
    ...     print("grows" in str(error))
    True
    """


class InputWarning(UserWarning):
    """Input that can be used but looks wrong: a unit slip, a dead or clipped channel."""
