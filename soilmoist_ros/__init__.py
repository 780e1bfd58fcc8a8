"""Map soil moisture with a cosmic-ray neutron sensor on a robot: sense, map, explore, record.

The folders follow the data: ``sensing`` turns logger bytes into corrected, geo-tagged counts,
``mapping`` turns counts into a rate and soil-moisture map with its uncertainty, ``reporting``
writes that map for people and for other programs, ``simulation`` makes data of known truth.
"""

__version__ = "0.1.0"
