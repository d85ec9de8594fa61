"""What is the same in every audit: its panel, its codes and severities."""

from __future__ import annotations

LIMITS = (
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
"""What every audit says that it does not establish, word for word."""

SEVERITIES = {
    **dict.fromkeys(("FT105", "FT601", "FT602"), "error"),
    **dict.fromkeys(("FT102", "FT104", "FT202", "FT203", "FT402"), "warning"),
    **dict.fromkeys(("FT103", "FT107", "FT201", "FT204", "FT205", "FT403"), "info"),
    **dict.fromkeys(("FT404", "FT501", "FT701"), "info"),
    **dict.fromkeys([f"FTD0{n}" for n in range(1, 9)], "info"),
    "FT101": "error warning",  # it decides by its place alone
    "FT301": "warning info",  # the model answers a class where no rule fires
    "FT106": "warning error info",  # of another class: a contradiction, or a note
    "FT401": "warning error",  # never reached at all
}
"""Every code, and the severities that a finding of it can have."""
