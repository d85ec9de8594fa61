"""`fuzzytree show`: a model as a person reads it."""

from __future__ import annotations

import click

from fuzzytree.cli.talk import answer, answer_json, json_option


@click.command("show", short_help="Show a tree and its rules.")
@click.argument("model", metavar="MODEL")
@json_option
def command(model: str, as_json: bool) -> None:
    """Show a tree and its rules, with the numbers behind the words.

    MODEL is a file that fuzzytree wrote, YAML or ONNX.
    """
    import msgspec

    from fuzzytree import verbs
    from fuzzytree.report import text
    from fuzzytree.rulebase import RuleBase, fingerprint
    from fuzzytree.runtimes.onnxruntime import OnnxModel

    found = verbs.opened(model)
    if isinstance(found, OnnxModel):
        facts = text.onnx_facts(found)
        if as_json:
            answer_json(facts)
        else:
            answer("\n".join(text.fact_lines(facts)))
        return
    if not as_json:
        answer("\n".join(text.model_lines(found)))
        return
    answer_json(
        {
            "carrier": "rules" if isinstance(found, RuleBase) else "tree",
            "fingerprint": fingerprint(found),
            "inputs": found.inputs,
            "rules": text.rule_facts(found),
            "model": msgspec.to_builtins(found),
        }
    )
