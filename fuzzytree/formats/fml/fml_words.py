"""The words of FML (IEEE 1855-2016), for the reader and for the writer."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal

from fuzzytree.model.system import Defuzzifier, Hedge, SNorm, TNorm

NAMESPACE: Final = "http://www.ieee1855.org"
FAR: Final = 1e300
"""The flat side of a right or left gaussian ends beyond all values."""

TNORMS: Final[Mapping[str, TNorm]] = MappingProxyType(
    {
        "MIN": "minimum",
        "PROD": "product",
        "BSUM": "bounded difference",  # so the published schema; BDIF in the text
        "BDIF": "bounded difference",
        "DRS": "drastic product",
        "DRP": "drastic product",
        "EPROD": "einstein product",
        "HPROD": "hamacher product",
        "NILMIN": "nilpotent minimum",
    }
)
SNORMS: Final[Mapping[str, SNorm]] = MappingProxyType(
    {
        "MAX": "maximum",
        "PROBOR": "algebraic sum",
        "BSUM": "bounded sum",
        "DRS": "drastic sum",
        "ESUM": "einstein sum",
        "HSUM": "hamacher sum",
        "NILMAX": "nilpotent maximum",
    }
)
METHODS: Final[
    Mapping[
        str,
        Literal[
            "centroid",
            "bisector",
            "smallest of maximum",
            "largest of maximum",
            "mean of maximum",
        ],
    ]
] = MappingProxyType(
    {
        "COG": "centroid",
        "COA": "bisector",
        "LM": "smallest of maximum",
        "RM": "largest of maximum",
        "MOM": "mean of maximum",
    }
)
USUAL: Final = Defuzzifier("centroid", 1000, "middle")
"""FML says nothing of samples; its reference implementation takes 1000."""

MODIFIERS: Final[Mapping[str, Hedge]] = MappingProxyType(
    {
        "any": "any",
        "not": "not",
        "very": "very",
        "somewhat": "somewhat",
        "seldom": "seldom",
        "plus": "plus",
        "extremely": "cubed",
        "intensify": "extremely",
        "more_or_less": "cube root",
    }
)
"""The modifiers with a meaning here; above, below, norm and slightly have none."""

OTHER_MODIFIERS: Final = ("above", "below", "norm", "slightly")
