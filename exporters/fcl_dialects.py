"""What each dialect of FCL has words for."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal

import msgspec

from fuzzytree.formats import FCL_METHODS, FCL_SNORMS, FCL_TNORMS
from fuzzytree.model import (
    FUNCTIONS,
    DefuzzifierMethod,
    SNorm,
    TNorm,
)

Dialect = Literal["portable", "iec", "fuzzylite", "jfuzzylogic"]


class FclWords(msgspec.Struct, frozen=True):
    """The words of a dialect, and what it can do.

    Attributes:
        name: The dialect.
        ands: The words for AND.
        ors: The words for OR.
        acts: The words for ACT.
        accus: The words for ACCU.
        methods: The words for METHOD.
        joiner: What stands between conclusions; empty where a rule has one.
        is_lower: Whether rules are written in lower case, and have no `;`.
        has_hedges: Whether it knows fuzzylite's hedges.
        has_not: Whether NOT can stand before parentheses.
        has_pair: Whether AND and OR belong together, so that one brings the other.
        reserved: Words that are no names.
        ignores_case: Whether names that differ only in case are alike.
    """

    name: Dialect
    ands: Mapping[TNorm, str]
    ors: Mapping[SNorm, str]
    acts: Mapping[TNorm, str]
    accus: Mapping[SNorm, str]
    methods: Mapping[DefuzzifierMethod, str]
    joiner: str = ", "
    is_lower: bool = False
    has_hedges: bool = False
    has_not: bool = True
    has_pair: bool = True
    reserved: tuple[str, ...] = ()
    ignores_case: bool = False


def _t_norms(words: str) -> dict[TNorm, str]:
    return {FCL_TNORMS[word]: word for word in words.split()}


def _s_norms(words: str) -> dict[SNorm, str]:
    return {FCL_SNORMS[word.upper()]: word for word in words.split()}


def _methods(words: str) -> dict[DefuzzifierMethod, str]:
    return {FCL_METHODS[word]: word for word in words.split()}


_ANDS, _ACTS = _t_norms("MIN PROD BDIF"), _t_norms("MIN PROD")
_ORS = _s_norms("MAX ASUM BSUM")
_FUZZYLITE_ANDS = _t_norms("MIN PROD BDIF DPROD EPROD HPROD NMIN")
_FUZZYLITE_ORS = _s_norms("MAX ASUM BSUM DSUM ESUM HSUM NMAX NSUM UnboundedSum")
_STANDARD: Final = (
    *("accu", "act", "and", "asum", "bdif", "bsum", "coa", "cog", "cogs", "default"),
    *("defuzzify", "end_defuzzify", "end_function_block", "end_fuzzify", "end_options"),
    *("end_ruleblock", "end_var", "function_block", "fuzzify", "if", "is", "lm", "max"),
    *("method", "min", "nc", "not", "nsum", "options", "or", "prod", "range", "real"),
    *("rm", "rule", "ruleblock", "term", "then", "var_input", "var_output", "with"),
    *("var", "int", "bool", "true", "false", "enabled", "lock", "any"),
)
_JFUZZYLOGIC: Final = (
    *_STANDARD,
    *("abs", "cosine", "cogf", "cos", "dmax", "dmin", "dsigm", "einstein", "exp"),
    *("hamacher", "function", "gauss", "gauss2", "gbell", "ln", "log", "nipmin"),
    *("nipmax", "mm", "probor", "sigm", "sin", "singletons", "sum", "tan", "trape"),
    *("trian", "x"),
)
_FUZZYLITE: Final = (
    *_STANDARD,
    *FUNCTIONS,
    *("fabs", "pow", "pi", "inf", "nan", "x", "very", "somewhat", "extremely"),
    *("seldom", "previous"),
)

WORDS: Mapping[Dialect, FclWords] = MappingProxyType(
    {
        "portable": FclWords(
            name="portable",
            ands=_ANDS,
            ors=_ORS,
            acts={},
            accus={},
            methods=_methods("COGS"),
            joiner="",
            is_lower=True,
            has_not=False,
            reserved=(*_FUZZYLITE, *_JFUZZYLOGIC),
            ignores_case=True,
        ),
        "iec": FclWords(
            name="iec",
            ands=_ANDS,
            ors=_ORS,
            acts=_ACTS,
            accus=_s_norms("MAX BSUM NSUM"),
            methods=_methods("COGS COG COA LM RM"),
            reserved=_STANDARD,
            ignores_case=True,
        ),
        "fuzzylite": FclWords(
            name="fuzzylite",
            ands=_FUZZYLITE_ANDS,
            ors=_FUZZYLITE_ORS,
            acts=_FUZZYLITE_ANDS,
            accus=_FUZZYLITE_ORS,
            methods=_methods("COGS COG COA LM RM MM COGSS"),
            joiner=" and ",
            is_lower=True,
            has_hedges=True,
            has_not=False,
            has_pair=False,
            reserved=_FUZZYLITE,
        ),
        "jfuzzylogic": FclWords(
            name="jfuzzylogic",
            ands=_t_norms("MIN PROD BDIF DMIN NIPMIN HAMACHER"),
            ors=_s_norms("MAX ASUM BSUM DMAX NIPMAX EINSTEIN"),
            acts=_ACTS,
            accus=_s_norms("MAX BSUM NSUM PROBOR SUM"),
            methods=_methods("COGS COG COA LM RM MM"),
            reserved=_JFUZZYLOGIC,
        ),
    }
)
"""The words of every dialect."""
