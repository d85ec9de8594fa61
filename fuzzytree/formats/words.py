"""What formats call norms, hedges, defuzzifiers and membership functions.

A new norm has a row here, and so has a new membership function whose numbers some
format writes as they are. Words that mean less simple things stand in the module of
their format.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Final, Literal, TypeVar

import msgspec

from fuzzytree.formats import shapes
from fuzzytree.formats.shapes import Engine, Maker
from fuzzytree.model import (
    Arc,
    Bell,
    Concave,
    Cosine,
    Curve,
    DefuzzifierMethod,
    Gaussian,
    Hedge,
    PiCurve,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    SNorm,
    Spike,
    SystemCurve,
    TNorm,
    TwoGaussians,
)

Column = Literal["fcl", "fll", "fis", "fuzzylite_fis", "fml"]
Meaning = TypeVar("Meaning", bound=str)


class Words(msgspec.Struct, frozen=True):
    """The words for one thing; several of a format are parted by blanks.

    The first one is written. `fuzzylite_fis` has what only fuzzylite knows of FIS.
    """

    fcl: str = ""
    fll: str = ""
    fis: str = ""
    fml: str = ""
    fuzzylite_fis: str = ""


T_NORM_WORDS: Final[Mapping[TNorm, Words]] = {
    "minimum": Words("MIN", "Minimum", "min", "MIN"),
    "product": Words("PROD", "AlgebraicProduct", "prod algebraic_product", "PROD"),
    # BSUM in the published schema of FML, BDIF in its text
    "bounded difference": Words(
        "BDIF", "BoundedDifference", "bounded_difference", "BSUM BDIF"
    ),
    "drastic product": Words(
        "DPROD DMIN", "DrasticProduct", "drastic_product", "DRS DRP"
    ),
    "einstein product": Words("EPROD", "EinsteinProduct", "einstein_product", "EPROD"),
    "hamacher product": Words(
        "HPROD HAMACHER", "HamacherProduct", "hamacher_product", "HPROD"
    ),
    "nilpotent minimum": Words(
        "NMIN NIPMIN", "NilpotentMinimum", "nilpotent_minimum", "NILMIN"
    ),
}
S_NORM_WORDS: Final[Mapping[SNorm, Words]] = {
    "maximum": Words("MAX", "Maximum", "max", "MAX"),
    "algebraic sum": Words(
        "ASUM PROBOR", "AlgebraicSum", "probor algebraic_sum", "PROBOR"
    ),
    "bounded sum": Words("BSUM", "BoundedSum", "bounded_sum", "BSUM"),
    "drastic sum": Words("DSUM DMAX", "DrasticSum", "drastic_sum", "DRS"),
    "einstein sum": Words("ESUM EINSTEIN", "EinsteinSum", "einstein_sum", "ESUM"),
    "hamacher sum": Words("HSUM", "HamacherSum", "hamacher_sum", "HSUM"),
    "nilpotent maximum": Words(
        "NMAX NIPMAX", "NilpotentMaximum", "nilpotent_maximum", "NILMAX"
    ),
    "normalized sum": Words("NSUM", "NormalizedSum", "normalized_sum"),
    "sum": Words("SUM", "UnboundedSum", "sum"),
}
METHOD_WORDS: Final[Mapping[DefuzzifierMethod, Words]] = {
    "centroid": Words("COG", "Centroid", "centroid", "COG"),
    "bisector": Words("COA BIS", "Bisector", "bisector", "COA"),
    "smallest of maximum": Words("LM SOM", "SmallestOfMaximum", "som", "LM"),
    "largest of maximum": Words("RM LOM", "LargestOfMaximum", "lom", "RM"),
    "mean of maximum": Words("MM MOM", "MeanOfMaximum", "mom", "MOM"),
    "weighted average": Words("COGS COGF", "WeightedAverage", "wtaver"),
    "weighted sum": Words("COGSS", "WeightedSum", "wtsum"),
}
HEDGE_WORDS: Final[Mapping[Hedge, Words]] = {
    "any": Words(fll="any", fml="any"),
    "not": Words(fll="not", fml="not"),
    "very": Words(fll="very", fml="very"),
    "somewhat": Words(fll="somewhat", fml="somewhat"),
    "extremely": Words(fll="extremely", fml="intensify"),
    "seldom": Words(fll="seldom", fml="seldom"),
    "plus": Words(fml="plus"),
    "cubed": Words(fml="extremely"),
    "cube root": Words(fml="more_or_less"),
}

_TWO = "slope inflection slope inflection"
FUNCTION_WORDS: Final[Mapping[type[SystemCurve], Words]] = {
    Arc: Words(fll="Arc start end"),
    Bell: Words(
        "GBELL width slope center",
        "Bell center |width| slope",
        "gbellmf |width| slope center",
    ),
    Concave: Words(
        fll="Concave inflection end", fuzzylite_fis="concavemf inflection end"
    ),
    Cosine: Words(fll="Cosine center width", fuzzylite_fis="cosinemf center width"),
    Gaussian: Words(
        "GAUSS mean deviation",
        "Gaussian mean |deviation|",
        "gaussmf |deviation| mean",
        "gaussianShape mean |deviation|",
    ),
    PiCurve: Words(fll="PiShape a b c d", fis="pimf a b c d"),
    Sigmoid: Words(
        "SIGM slope inflection", "Sigmoid inflection slope", "sigmf slope inflection"
    ),
    SigmoidDifference: Words(
        f"DSIGM {_TWO}",
        "SigmoidDifference inflection slope slope inflection",
        f"dsigmf {_TWO}",
    ),
    SigmoidProduct: Words(
        fll="SigmoidProduct inflection slope slope inflection", fis=f"psigmf {_TWO}"
    ),
    Spike: Words(fll="Spike center |width|", fuzzylite_fis="spikemf center width"),
    TwoGaussians: Words(
        fll="GaussianProduct left |left_deviation| right |right_deviation|",
        fis="gauss2mf |left_deviation| left |right_deviation| right",
    ),
}
"""The word for a membership function, and its numbers in the order of the file.

Of a number between bars the size counts, and not the sign.
"""


SHAPE_WORDS: Final[Mapping[Maker, Words]] = {
    shapes.triangle: Words(
        "TRIAN a b c", "Triangle a b c", "trimf a b c", "triangularShape a b c"
    ),
    shapes.trapezoid: Words(
        "TRAPE a b c d", "Trapezoid a b c d", "trapmf a b c d", "trapezoidShape a b c d"
    ),
    partial(shapes.line, falls=True): Words(
        "", "", "linzmf a b", "leftLinearShape a b"
    ),
    shapes.line: Words("", "", "linsmf a b", "rightLinearShape a b"),
    shapes.s_shape: Words("", "SShape start end", "smf start end", "sShape a b"),
    partial(shapes.s_shape, falls=True): Words(
        "", "ZShape start end", "zmf start end", "zShape a b"
    ),
    shapes.ramp: Words("", "Ramp start end", fuzzylite_fis="rampmf start end"),
    shapes.rectangle: Words(
        "", "Rectangle start end", "", "rectangularShape a b", "rectmf start end"
    ),
    shapes.binary: Words(
        "", "Binary start direction", "", "", "binarymf start direction"
    ),
}
"""The words for membership functions whose numbers mean another one in some order."""


def meanings(table: Mapping[Meaning, Words], *columns: Column) -> dict[str, Meaning]:
    """Return what each word of a format means.

    Example:
        >>> list(meanings(T_NORM_WORDS, "fml"))[:3]
        ['MIN', 'PROD', 'BSUM']
    """
    return {
        word: meaning
        for column in columns
        for meaning, words in table.items()
        for word in getattr(words, column).split()
    }


def word_for(
    words: Mapping[str, Meaning], meaning: str | None, default: str = ""
) -> str:
    """Return the first word with a meaning, a default if there is none.

    Example:
        >>> word_for(meanings(T_NORM_WORDS, "fis"), "product")
        'prod'
    """
    return next((word for word, known in words.items() if known == meaning), default)


class FunctionWord(msgspec.Struct, frozen=True):
    """A word for membership functions.

    Attributes:
        numbers: What its numbers are, in the order of the file.
        make: What they make in an engine; it raises ValueError for wrong ones.
        numbers_of: The numbers of a function, None of one that the word cannot say.
    """

    numbers: str
    make: Maker
    numbers_of: Callable[[Curve], Sequence[float] | None] = lambda _: None

    @property
    def arity(self) -> int:
        """How many numbers it has."""
        return len(self.numbers.split())


FunctionWords = Mapping[str, FunctionWord]


def in_words(curve: Curve, words: FunctionWords) -> tuple[str, list[float]] | None:
    """Return the word for a membership function and its numbers, if there is one.

    Example:
        >>> in_words(Gaussian(5.0, 2.0), function_words("fis"))
        ('gaussmf', [2.0, 5.0])
    """
    for name, word in words.items():
        numbers = word.numbers_of(curve)
        if numbers is not None:
            return name, [*numbers]
    return None


def function_words(*columns: Column) -> dict[str, FunctionWord]:
    """Return the words of a format for membership functions.

    Example:
        >>> function_words("fll")["Gaussian"].make([5.0, -2.0], "fuzzylite")
        Gaussian(mean=5.0, deviation=2.0)
    """
    words: dict[str, FunctionWord] = {}
    for column in columns:
        for make, spellings in SHAPE_WORDS.items():
            name, _, numbers = getattr(spellings, column).partition(" ")
            if name:
                words[name] = FunctionWord(numbers, make)
        for kind, spellings in FUNCTION_WORDS.items():
            if text := getattr(spellings, column):
                words |= [_spelled(kind, text)]
    return words


def _spelled(kind: type[SystemCurve], text: str) -> tuple[str, FunctionWord]:
    name, *marked = text.split()
    fields = _fields(kind)
    plain = [one.strip("|") for one in marked]
    order: list[int] = []
    for place, one in enumerate(plain):
        places = [k for k, field in enumerate(fields) if field == one]
        order.append(places[plain[:place].count(one)])

    def make(numbers: Sequence[float], engine: Engine) -> Curve:
        values = [0.0] * len(order)
        for place, number, one in zip(order, numbers, marked, strict=True):
            values[place] = abs(number) if one.startswith("|") else number
        return shapes.difference_of(_built(kind, values), engine)

    def numbers_of(curve: Curve) -> Sequence[float] | None:
        if type(curve) is not kind:
            return None
        numbers = _numbers(curve)
        return [numbers[place] for place in order]

    return name, FunctionWord(" ".join(plain), make, numbers_of)


def _fields(kind: type[Curve]) -> list[str]:
    """Return the fields of a function; of one made of sigmoids those of each."""
    names: list[str] = []
    for field in msgspec.structs.fields(kind):
        names += _fields(Sigmoid) if field.type is Sigmoid else [field.name]
    return names


def _built(kind: Callable[..., Curve], values: Sequence[float]) -> Curve:
    if kind in (SigmoidDifference, SigmoidProduct):
        return kind(Sigmoid(*values[:2]), Sigmoid(*values[2:]))
    return kind(*values)


def _numbers(curve: Curve) -> list[float]:
    numbers: list[float] = []
    for name in curve.__struct_fields__:
        value = getattr(curve, name)
        numbers += _numbers(value) if isinstance(value, Sigmoid) else [value]
    return numbers
