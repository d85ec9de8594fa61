"""Which check an answer of a code needs: of a proof, or of what a witness shows."""

from __future__ import annotations

from collections.abc import Callable

from fuzzytree.auditing.recheck.audit_records import Answer, Witness
from fuzzytree.auditing.recheck.cases import Case
from fuzzytree.auditing.recheck.deciding_leaves import shows_difference, shows_region
from fuzzytree.auditing.recheck.deciding_pairs import (
    apart,
    copied,
    hidden,
    needless,
    shows_conflict,
    shows_need,
)
from fuzzytree.auditing.recheck.deciding_terms import (
    complexity,
    heights,
    overlaps,
    unused,
)
from fuzzytree.auditing.recheck.deciding_wins import (
    covered,
    dead,
    shows_gap,
    shows_lead,
    shows_tie,
    shows_win,
    superfluous,
    tied,
)
from fuzzytree.auditing.recheck.outcomes import UndecidedError

AGAIN: dict[str, Callable[[Case, Answer], None]] = {
    "FT101": dead,
    "FT103": superfluous,
    "FT104": hidden,
    "FT105": hidden,
    "FT106": copied,
    "FT107": needless,
    "FT201": apart,
    "FT202": tied,
    "FT301": covered,
    "FT401": heights,
    "FT403": overlaps,
    "FT404": unused,
    "FT501": complexity,
}
SHOWS: dict[str, Callable[[Case, Answer, Witness], None]] = {
    "FT101": shows_win,
    "FT102": shows_lead,
    "FT103": shows_win,
    "FT107": shows_need,
    "FT201": shows_conflict,
    "FT202": shows_tie,
    "FT203": shows_difference,
    "FT205": shows_region,
    "FT301": shows_gap,
}
WHY = {
    "FT402": "the turning points of curves are not looked at here",
    "FT601": "nothing is run here but the model itself",
    "FT602": "nothing is run here but the model itself",
}


def decide(case: Case, answer: Answer) -> None:
    """Decide again what an answer says is proved.

    Raises:
        DoesNotHoldError: If it is not so.
        UndecidedError: If that cannot be told here.
    """
    again = AGAIN.get(answer.code)
    if again is None:
        why = WHY.get(answer.code, "there is no second way for it here")
        raise UndecidedError(why)
    again(case, answer)


def shows(case: Case, answer: Answer, state: Witness) -> None:
    """Ask that the claims of a witness are those that its code is about.

    Raises:
        DoesNotHoldError: If they are others.
    """
    if answer.code in SHOWS:
        SHOWS[answer.code](case, answer, state)
