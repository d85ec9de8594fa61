"""What an audit does not establish: the same sentences in every audit, and its digest.

An audit without its limits is a promise that nobody gave, so they are part of the
result, of every page made of it, and of what the digest is taken over.
"""

from __future__ import annotations

import hashlib
import json
from typing import Final

import msgspec

from fuzzytree.auditing.findings.records import Audit

LIMITS: Final = (
    "that the rules are right: an audit finds what a rule base says, not whether it is "
    "true of the world",
    "anything outside the domain: every answer holds on the stated ranges and nowhere "
    "else",
    "that all of the domain can happen: inputs are asked in every combination, also in "
    "those that no row will ever have",
    "more about a sampled share than its interval says, and that only with the stated "
    "confidence",
    "what a bracket leaves open: the number lies between the two ends, and nothing "
    "more is known",
    "anything about what was declined or not asked; both are listed",
    "that strengths which only touch are told: ties and gaps without an interior are "
    "left out",
    "what rounding changes: answers are about real numbers at the doubles of the "
    "model, and a runtime may differ where strengths nearly tie",
    "that other files, runtimes or devices answer alike: only what was compared is "
    "compared",
    "that the given rows are right, or stand for those to come",
    "who made this audit: the digest shows an edit, and is no signature",
)
"""Each finishes the sentence "This audit does not establish ..."."""


def digest_of(audit: Audit) -> str:
    """Return the SHA-256 of an audit's canonical JSON, as 64 hexadecimal digits.

    The canonical JSON has sorted keys, no spaces, every character as it is, and an
    empty digest: `json.dumps(facts, sort_keys=True, separators=(",", ":"),
    ensure_ascii=False)` of what the file holds, as UTF-8.
    """
    facts = json.loads(msgspec.json.encode(audit))
    facts["digest"] = ""
    text = json.dumps(facts, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()
