"""Places on an axis are joined only where they are one."""

from fractions import Fraction

from fuzzytree.proving.elements import Place, _apart
from fuzzytree.proving.polynomials import Polynomial, Root

SMALL = Fraction(1, 2**70)


def _touching(of: Polynomial) -> list[Place]:
    """Return what becomes of a place at 0 and a root from 0 on."""
    ends = Fraction(0), Fraction(1, 2**60)
    return _apart([Place(ends[0], ends[0]), Place(*ends, (of, Root(*ends)))])


def test_a_root_beside_an_exact_place_that_is_a_root_too_stays() -> None:
    other = (Fraction(0), -2 * SMALL / 3, Fraction(1))  # 0 at 0 and just above
    assert len(_touching(other)) == 2


def test_a_double_root_at_an_exact_place_is_that_place() -> None:
    ends = Fraction(-1), Fraction(1)
    of = (Fraction(0), Fraction(0), Fraction(1))
    vague = Place(*ends, (of, Root(*ends, is_sure=False)))
    assert _apart([vague, Place(Fraction(0), Fraction(0))]) == [
        Place(Fraction(0), Fraction(0))
    ]
