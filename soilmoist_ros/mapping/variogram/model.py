"""Variogram models, and the empirical semivariogram of counts.

Monestiez, Dubroca, Bonnin, Durbec & Guinet (2006), Ecological Modelling 193:615-628.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.mapping.samples.samples import Samples, as_samples

Array = NDArray[np.float64]
ModelName = Literal["gaussian", "exponential", "spherical", "matern32", "matern52"]


class CorrelationModel(NamedTuple):
    """A correlation function of the squared distance in units of the range, ``q = (h / range_m)**2``.

    :param correlation: q -> correlation; may overwrite q, which is a float array of any shape
    :param with_slope: q -> correlation and d(correlation) / d(log range); may overwrite q
    :param practical: distance, in units of the range, at which 95 % of the structured variance is reached
        (spherical: all of it, as is usual)
    """

    correlation: Callable[[Array], Array]
    with_slope: Callable[[Array], tuple[Array, Array]]
    practical: float


def _gaussian(q: Array) -> Array:
    np.exp(np.negative(q, out=q), out=q)
    return q


def _gaussian_both(q: Array) -> tuple[Array, Array]:
    value = np.exp(-q)
    q *= 2
    q *= value
    return value, q


def _exponential(q: Array) -> Array:
    np.sqrt(q, out=q)
    return _gaussian(q)


def _exponential_both(q: Array) -> tuple[Array, Array]:
    np.sqrt(q, out=q)
    value = np.exp(-q)
    q *= value
    return value, q


def _spherical(q: Array) -> Array:
    u = np.minimum(np.sqrt(q, out=q), 1.0, out=q)
    cubic = u * u
    cubic -= 3.0
    cubic *= u
    cubic *= 0.5
    cubic += 1.0
    return cubic


def _spherical_both(q: Array) -> tuple[Array, Array]:
    u: Array = np.minimum(np.sqrt(q), 1.0)
    return _spherical(q), 1.5 * u * (1 - u * u)


def _matern32(q: Array) -> Array:
    a = np.sqrt(np.multiply(q, 3.0, out=q), out=q)
    decay = np.exp(-a)
    a += 1.0
    a *= decay
    return a


def _matern32_both(q: Array) -> tuple[Array, Array]:
    q *= 3.0
    a = np.sqrt(q)
    decay = np.exp(-a)
    q *= decay
    a += 1.0
    a *= decay
    return a, q


def _matern52(q: Array) -> Array:
    a = np.sqrt(np.multiply(q, 5.0, out=q), out=q)
    decay = np.exp(-a)
    polynomial = a / 3
    polynomial += 1.0
    polynomial *= a
    polynomial += 1.0
    polynomial *= decay
    return polynomial


def _matern52_both(q: Array) -> tuple[Array, Array]:
    q *= 5.0
    a = np.sqrt(q)
    decay = np.exp(-a)
    q /= 3.0
    a += 1.0
    value = a + q
    value *= decay
    q *= a
    q *= decay
    return value, q


MODELS: dict[str, CorrelationModel] = {
    "gaussian": CorrelationModel(_gaussian, _gaussian_both, 1.7308183826022854),
    "exponential": CorrelationModel(_exponential, _exponential_both, 2.995732273553991),
    "spherical": CorrelationModel(_spherical, _spherical_both, 1.0),
    "matern32": CorrelationModel(_matern32, _matern32_both, 2.73887145669191),
    "matern52": CorrelationModel(_matern52, _matern52_both, 2.64690045466485),
}


@dataclass(frozen=True)
class Variogram:
    """A variogram model of the latent count rate.

    ``gamma(h) = nugget + (sill - nugget) * (1 - rho(h))`` for h > 0, ``gamma(0) = 0``, with u = h / range_m:

    ============  ==================================  =====================
    model         rho                                 range in PyKrige
    ============  ==================================  =====================
    gaussian      exp(-u^2)                           7/4 range_m
    exponential   exp(-u)                             3 range_m
    spherical     1 - 1.5 u + 0.5 u^3, 0 from u = 1   range_m
    matern32      (1 + s) exp(-s), s = sqrt(3) u      -
    matern52      (1 + s + s^2/3) exp(-s), s = sqrt(5) u   -
    ============  ==================================  =====================

    With a geometric anisotropy (Chiles & Delfiner 2012, Geostatistics, section 2.5.2) the range depends on the
    direction as the radius of an ellipse does: ``range_m`` is the geometric mean of the longest and the shortest,
    ``range_m * sqrt(anisotropy)`` along ``angle_deg`` and ``range_m / sqrt(anisotropy)`` across. The methods that
    take a distance are those of the directions in which the range is ``range_m``.

    :param model: one of the above
    :param nugget: micro-scale variance of the rate, Poisson noise not included [(counts/s)^2], >= 0
    :param range_m: range parameter [m], > 0; the geometric mean of the longest and the shortest
    :param sill: *total* sill, nugget included [(counts/s)^2], >= nugget
    :param anisotropy: longest range over shortest range [-], >= 1; 1 if no direction is special
    :param angle_deg: direction of the longest range, anticlockwise from east [deg]; kept modulo 180
    :raises ValueError: if the model is unknown or a parameter is out of its range
    """

    model: ModelName
    nugget: float
    range_m: float
    sill: float
    anisotropy: float = 1.0
    angle_deg: float = 0.0

    def __post_init__(self) -> None:
        check_model(self.model)
        for name in ("nugget", "range_m", "sill", "anisotropy", "angle_deg"):
            value = float(getattr(self, name))
            if not np.isfinite(value):
                raise ValueError(f"{name} must be finite, got {value}")
            object.__setattr__(self, name, value)
        if self.nugget < 0:
            raise ValueError(f"nugget must be >= 0, got {self.nugget}")
        if self.range_m <= 0:
            raise ValueError(f"range_m must be > 0, got {self.range_m}")
        if self.sill < self.nugget:
            raise ValueError(
                f"sill is the total sill and must be >= nugget ({self.nugget}), got {self.sill}; "
                "add the nugget if you have a partial sill"
            )
        if self.anisotropy < 1:
            raise ValueError(
                f"anisotropy is the longest range over the shortest and must be >= 1, got {self.anisotropy}; "
                "turn angle_deg by 90 and give its inverse"
            )
        object.__setattr__(self, "angle_deg", self.angle_deg % 180.0 % 180.0)  # twice: -1e-20 % 180 is 180

    @property
    def structured_sill(self) -> float:
        """Variance of the spatially correlated part, ``sill - nugget`` [(counts/s)^2]."""
        return self.sill - self.nugget

    @property
    def practical_range_m(self) -> float:
        """Distance at which 95 % of the structured variance is reached (spherical: all of it) [m]."""
        return self.range_m * MODELS[self.model].practical

    @property
    def along_axes(self) -> bool:
        """Whether the longest range lies along an axis, or no direction is special."""
        return self.anisotropy == 1 or self.angle_deg % 90 == 0

    def scaled(self, xy: Array) -> Array:
        """Places in the plane where the variogram is isotropic, in units of the range.

        :param xy: places or displacements, shape (..., 2) [m]
        :returns: the same shape, new memory; its squared distances are what :meth:`correlation_of_square` takes
        """
        if self.anisotropy == 1:
            return xy / self.range_m
        return np.asarray(xy @ isotropic_plane(self.anisotropy, self.angle_deg) / self.range_m)

    def __call__(self, h_m: ArrayLike) -> Array:
        """Semivariance, see :meth:`semivariance`."""
        return self.semivariance(h_m)

    def semivariance(self, h_m: ArrayLike) -> Array:
        """Semivariance at distances of any shape [m] -> [(counts/s)^2]; 0 at distance 0."""
        h = np.asarray(h_m, float)
        return np.where(h == 0, 0.0, self.nugget + self.structured_sill * (1 - self.correlation(h)))

    def correlation(self, h_m: ArrayLike) -> Array:
        """Correlation of the structured part at distances of any shape [m]; 1 at distance 0."""
        return self.correlation_of_square((np.asarray(h_m, float) / self.range_m) ** 2)

    def covariance(self, h_m: ArrayLike) -> Array:
        """Covariance of the rate at distances of any shape [m]; the nugget only at distance 0."""
        h = np.asarray(h_m, float)
        return self.structured_sill * self.correlation(h) + np.where(h == 0, self.nugget, 0.0)

    def correlation_of_square(self, q: ArrayLike) -> Array:
        """Correlation of the structured part at squared distances in units of the range.

        May overwrite its argument: for inner loops, where a square root or a copy would cost.
        """
        return MODELS[self.model].correlation(np.atleast_1d(np.asarray(q, float))).reshape(np.shape(q))


def isotropic_plane(anisotropy: float, angle_deg: float) -> Array:
    """Matrix M, shape (2, 2), so that places ``xy @ M`` have the same range in all directions: the geometric mean.

    Symmetric, of determinant 1, and exactly diagonal where the longest range lies along an axis.

    :param anisotropy: longest range over shortest range [-], >= 1
    :param angle_deg: direction of the longest range, anticlockwise from east [deg]
    """
    along, across = 1 / np.sqrt(anisotropy), np.sqrt(anisotropy)
    if angle_deg % 90 == 0:
        return np.diag([along, across] if angle_deg % 180 == 0 else [across, along])
    cosine, sine = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    axes = np.array([[cosine, sine], [-sine, cosine]])  # along and across, in the rows
    return np.asarray(axes.T * [along, across] @ axes)


def check_model(model: str) -> None:
    """Refuse the name of an unknown model.

    :raises ValueError: listing the known ones
    """
    if model not in MODELS:
        raise ValueError(f"unknown variogram model {model!r}; known are {', '.join(MODELS)}")


def empirical_semivariogram(
    xy: ArrayLike, counts: ArrayLike, exposure_s: ArrayLike, edges: ArrayLike
) -> tuple[Array, Array, Array]:
    """Semivariogram of the latent rate from Poisson counts, weighted by exposure (Monestiez et al. 2006).

    Over the pairs i < j of the class ``lo < h <= hi``, with w = t_i t_j / (t_i + t_j)::

        gamma = sum(w (Z_i/t_i - Z_j/t_j)^2 - m*) / (2 sum(w)),   m* = sum(Z) / sum(t)

    The term -m* takes the Poisson noise out, without bias; a class may therefore come out negative.
    A sample is never paired with itself. Pairs at one place (h = 0) are in no class whose ``lo`` is 0.

    :param xy: places, shape (n, 2) [m]
    :param counts: raw counts, shape (n,)
    :param exposure_s: effective exposures, shape (n,) [s]
    :param edges: edges of the classes, strictly increasing, >= 0, length k + 1 [m]
    :returns: (lag_m, gamma, weight), each of length k: the w-weighted mean distance, the semivariance, the
        sum of w [s]; NaN, NaN, 0 in an empty class
    :raises ValueError: as :class:`Samples`, or for unusable edges
    """
    return semivariogram_of(as_samples(xy, counts, exposure_s), edges)


def semivariogram_of(samples: Samples, edges: ArrayLike) -> tuple[Array, Array, Array]:
    """As :func:`empirical_semivariogram`, of samples that have been checked."""
    limits = np.asarray(edges, float)
    if limits.ndim != 1 or len(limits) < 2:
        raise ValueError("edges must hold at least two values")
    if not (np.isfinite(limits).all() and limits[0] >= 0 and (np.diff(limits) > 0).all()):
        raise ValueError("edges must be finite, >= 0 and strictly increasing")
    sums = np.zeros((4, len(limits) - 1))
    for rows in _pair_blocks(len(samples)):
        sums += _block_sums(samples, rows, limits)
    weight, distance, squares, pairs = sums
    with np.errstate(invalid="ignore"):
        gamma = (squares - samples.mean_rate_cps * pairs) / (2 * weight)
        return distance / weight, gamma, weight


def default_edges(xy: ArrayLike, classes: int = 15, min_pairs: int = 30, few_classes: int = 6) -> Array:
    """Edges of distance classes that suit these places [m].

    Classes of equal width up to half the largest distance (where pairs stop being plentiful); a class with
    fewer than ``min_pairs`` pairs is widened until it has them. Where that leaves fewer than ``few_classes``,
    as with the first twenty samples or so of a mission, there are ``few_classes`` of equal width over all
    distances instead, as PyKrige has them: three parameters cannot be fitted to one or two classes. Beyond
    2000 places every k-th one is looked at.

    :param xy: places, shape (n, 2), at least two distinct [m]
    :param classes: largest number of classes
    :param min_pairs: pairs that a class should have
    :param few_classes: number of classes while pairs are few
    :raises ValueError: with fewer than two distinct places
    """
    from scipy.spatial.distance import pdist

    places = np.asarray(xy, float).reshape(-1, 2)
    places = places[np.lexsort(places.T[::-1])]
    places = places[np.append(True, (places[1:] != places[:-1]).any(axis=1))[: len(places)]]
    if len(places) < 2:
        raise ValueError("distance classes need samples at two or more distinct places")
    distances = pdist(places[:: -(-len(places) // 2000)])
    reach = distances.max() * (1 + 1e-9)
    if len(distances) < few_classes * min_pairs:
        return np.linspace(0, reach, few_classes + 1)
    limits = np.linspace(0, reach / 2, classes + 1)
    per_class = np.histogram(distances, limits)[0]
    edges, pairs = [0.0], 0
    for upper, found in zip(limits[1:], per_class, strict=True):
        pairs += found
        if pairs >= min_pairs:
            edges.append(upper)
            pairs = 0
    if len(edges) - 1 < few_classes:
        return np.linspace(0, reach, few_classes + 1)
    edges[-1] = limits[-1]  # the remainder joins the last class
    return np.array(edges)


def _pair_blocks(n: int, elements: int = 1_000_000) -> list[slice]:
    """Row blocks of the n x n pairs, each of about so many elements."""
    step = max(1, elements // max(n, 1))
    return [slice(start, min(start + step, n)) for start in range(0, n, step)]


def _block_sums(samples: Samples, rows: slice, limits: Array) -> Array:
    """Sums of w, w h, w (rate difference)^2 and 1 per class, over pairs i < j with i in the rows."""
    from scipy.spatial.distance import cdist

    h = cdist(samples.xy[rows], samples.xy[rows.start :])
    i, j = np.nonzero(np.triu((h > limits[0]) & (h <= limits[-1]), 1))
    h = h[i, j]
    t, rate = samples.exposure_s[rows.start :], samples.rate_cps[rows.start :]
    w = t[i] * t[j] / (t[i] + t[j])
    squares = w * (rate[i] - rate[j]) ** 2
    number = np.searchsorted(limits, h, side="left") - 1
    columns = (w, w * h, squares, None)
    return np.array([np.bincount(number, column, len(limits) - 1) for column in columns], float)
