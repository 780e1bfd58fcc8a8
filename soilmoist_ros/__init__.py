"""Map soil moisture with a cosmic-ray neutron sensor on a robot: sense, map, explore, record.

The folders follow the data: ``sensing`` turns logger bytes into corrected, geo-tagged counts,
``mapping`` turns counts into a rate and soil-moisture map with its uncertainty, ``reporting``
writes that map for people and for other programs, ``simulation`` makes data of known truth.
"""

import os

# Read when numpy is imported. Matrices are small: with more BLAS threads a map takes longer, and its last digits
# differ from one run to the next, so that it could not be computed again bit for bit.
for _variable in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

__version__ = "0.1.0"
