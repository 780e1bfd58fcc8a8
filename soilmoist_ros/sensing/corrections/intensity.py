# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Scaling of the incoming intensity from a neutron monitor to the site.

A monitor and a probe respond differently to a change of the cosmic rays, depending on cutoff rigidity and
atmospheric depth. With the rate C of the monitor and its reference C0 the correction factor is
``1 / (1 + k (C / C0 - 1))``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from soilmoist_ros.sensing.corrections.atmosphere import atmospheric_depth_gcm2
from soilmoist_ros.sensing.corrections.cutoff_rigidity import cutoff_rigidity_gv

Scaling = Literal["none", "hawdon2014", "mcjannet2023"]


@dataclass(frozen=True)
class CosmicPlace:
    """What a place means for cosmic rays.

    :param cutoff_rigidity_gv: vertical cutoff rigidity [GV]
    :param depth_gcm2: atmospheric depth [g/cm^2]
    """

    cutoff_rigidity_gv: float
    depth_gcm2: float


MONITORS: dict[str, tuple[str, float, float, float]] = {
    "AATB": ("Alma-Ata B", 43.14, 76.60, 3340),
    "APTY": ("Apatity", 67.57, 33.40, 181),
    "ATHN": ("Athens", 37.97, 23.78, 260),
    "BKSN": ("Baksan", 43.28, 42.69, 1700),
    "CLMX": ("Climax", 39.37, -106.18, 3400),
    "DOMC": ("Dome C", -75.10, 123.33, 3233),
    "DRBS": ("Dourbes", 50.10, 4.59, 225),
    "FSMT": ("Fort Smith", 60.02, -111.93, 180),
    "HRMS": ("Hermanus", -34.43, 19.23, 26),
    "INVK": ("Inuvik", 68.36, -133.72, 21),
    "IRKT": ("Irkutsk", 52.47, 104.03, 435),
    "JUNG": ("Jungfraujoch (IGY)", 46.55, 7.98, 3570),
    "JUNG1": ("Jungfraujoch (NM64)", 46.55, 7.98, 3475),
    "KERG": ("Kerguelen", -49.35, 70.25, 33),
    "KIEL": ("Kiel", 54.34, 10.12, 54),
    "LMKS": ("Lomnicky stit", 49.20, 20.22, 2634),
    "MOSC": ("Moscow", 55.47, 37.32, 200),
    "MXCO": ("Mexico City", 19.33, -99.18, 2274),
    "NAIN": ("Nain", 56.55, -61.68, 46),
    "NEWK": ("Newark", 39.68, -75.75, 50),
    "OULU": ("Oulu", 65.05, 25.47, 15),
    "PSNM": ("Doi Inthanon", 18.59, 98.49, 2565),
    "PTFM": ("Potchefstroom", -26.68, 27.10, 1351),
    "PWNK": ("Peawanuck", 54.98, -85.44, 53),
    "ROME": ("Rome", 41.86, 12.47, 0),
    "SOPO": ("South Pole", -90.0, 0.0, 2820),
    "TERA": ("Terre Adelie", -66.65, 140.00, 32),
    "THUL": ("Thule", 76.50, -68.70, 26),
    "TSMB": ("Tsumeb", -19.20, 17.58, 1240),
    "YKTK": ("Yakutsk", 62.01, 129.43, 105),
}
"""Neutron monitors of the database NMDB (www.nmdb.eu): name, latitude, longitude [deg] and altitude [m]."""


def cosmic_place(
    latitude_deg: float, longitude_deg: float, altitude_m: float, rigidity_gv: float | None = None
) -> CosmicPlace:
    """Cutoff rigidity and atmospheric depth of a place.

    :param rigidity_gv: known cutoff rigidity [GV]; from the table if ``None``
    :raises ValueError: if a value is out of range
    """
    if rigidity_gv is None:
        rigidity_gv = cutoff_rigidity_gv(latitude_deg, longitude_deg)
    return CosmicPlace(rigidity_gv, atmospheric_depth_gcm2(latitude_deg, altitude_m))


def intensity_scale(scaling: Scaling, site: CosmicPlace, monitor: CosmicPlace) -> float:
    """Relative change of the intensity at the site for a relative change of 1 at the monitor, k [-].

    * ``none``: 1 (Zreda et al. 2012, Hydrology and Earth System Sciences 16:4079-4099)
    * ``hawdon2014``: ``1 - 0.075 (Rc_site - Rc_monitor)`` (Hawdon et al. 2014, Water Resources Research
      50:5029-5043)
    * ``mcjannet2023``: ``tau(site) / tau(monitor)`` (McJannet & Desilets 2023, Water Resources Research
      59:e2022WR033889), see :func:`_tau`

    :raises ValueError: if the scale is not positive
    """
    scale = 1.0
    if scaling == "hawdon2014":
        scale = 1 - 0.075 * (site.cutoff_rigidity_gv - monitor.cutoff_rigidity_gv)
    elif scaling == "mcjannet2023":
        scale = _tau(site) / _tau(monitor)
    if not scale > 0:
        raise ValueError(f"the intensity would be scaled by {scale:.2f}: the cutoff rigidities differ too much")
    return scale


def _tau(place: CosmicPlace) -> float:
    """Response of a neutron monitor to solar modulation, in proportion (McJannet & Desilets 2023) [-]."""
    depth = place.depth_gcm2
    # At low rigidity the atmosphere cuts the spectrum off; the formula is flat there.
    rigidity = max(place.cutoff_rigidity_gv, 0.01)
    return (-0.0009 * depth + 1.7699) * (
        1 - math.exp(-(0.0064 * depth + 1.8855) * rigidity ** (0.000013 * depth - 1.2237))
    )
