"""`fuzzytree check` says what agrees, and exits with 1 if something does not."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import onnx
import pytest
from msgspec.structs import replace
from onnx import numpy_helper

import fuzzytree as ft
from fuzzytree.errors import DisagreementError
from fuzzytree.model.agreement import Agreement, Certified, Comparison
from fuzzytree.report.text import agreement_lines
from tests.cli.conftest import Call, grip
from tests.interop.matrix_models import write_model

NATIVE = ("--runtime", "native", "--generate", "200")


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    pass


def test_a_model_and_its_files_agree(call: Call) -> None:
    words = ("rules.yaml", "grip.onnx", "--data", "grasps.csv")
    code, out, err = call("check", "grip.yaml", *words, *NATIVE)
    assert code == 0
    lines = out.splitlines()
    assert lines[0].startswith("grip: none of ")
    assert lines[0].endswith(" generated rows, 4 rows of data, 4 regions between cuts)")
    assert lines[1].split("  ")[0] == "compared with"
    assert "DISAGREES" not in out
    assert err == ""
    _, full, _ = call("check", "grip.yaml", *words, *NATIVE, "--verbose")
    assert full.splitlines()[0] == lines[0]
    assert full.splitlines()[1].split() == [
        *("representation", "compared", "with", "on", "rows"),
        *("largest", "difference", "allowed", "verdict"),
    ]
    assert len(full.splitlines()) > len(lines)


def test_a_changed_cut_is_found(call: Call) -> None:
    text = Path("grip.yaml").read_text("utf-8")
    Path("other.yaml").write_text(text.replace("0.5", "0.5000000000000001"), "utf-8")
    code, out, _ = call("check", "grip.yaml", "other.yaml", *NATIVE)
    assert code == 1
    assert "DISAGREES" in out
    assert "disagree" in out.splitlines()[0]


def test_a_swapped_class_in_an_onnx_file_is_found(call: Call) -> None:
    content = ft.export(grip(), "onnx").content
    swapped = content.replace(b"firm", b"tmp!").replace(b"soft", b"firm")
    Path("swapped.onnx").write_bytes(swapped.replace(b"tmp!", b"soft"))
    code, out, _ = call("check", "grip.yaml", "swapped.onnx", *NATIVE)
    assert code == 1
    assert "DISAGREES" in out


def test_json_reports_the_same_facts(call: Call) -> None:
    code, out, _ = call("check", "grip.yaml", "--json", "--quiet", *NATIVE)
    facts = json.loads(out)
    assert code == 0
    assert facts["ok"] is True
    assert facts["comparisons"]


def test_quiet_leaves_the_table_and_the_exit_code_alone(call: Call) -> None:
    loud = call("check", "grip.yaml", *NATIVE)
    quiet = call("check", "grip.yaml", "--quiet", *NATIVE)
    assert quiet == (0, loud[1], "")


def test_an_unknown_runtime_is_one_sentence(call: Call) -> None:
    code, out, err = call("check", "grip.yaml", "--runtime", "nativ")
    assert (code, out) == (2, "")
    assert err.startswith("no runtime 'nativ'")
    assert "(did you mean 'native'?)" in err


def test_rows_that_do_not_fit_are_one_sentence(call: Call) -> None:
    Path("few.csv").write_text("force\n1\n", "utf-8")
    message = "few.csv has no column 'slip', which the model needs; it has force\n"
    assert call("check", "grip.yaml", "--data", "few.csv") == (2, "", message)


def test_comparisons_that_agree_are_counted_unless_all_are_wanted(call: Call) -> None:
    short = call("check", "grip.yaml", *NATIVE)[1]
    full = call("check", "grip.yaml", "--verbose", *NATIVE)[1]
    line = "itself, in other calls  2            0                   2 agree\n"
    assert line in short
    assert line not in full
    assert full.count(" calls ") == 2


def test_a_disagreement_is_reported_with_its_worst_row() -> None:
    wrong = Comparison(
        "x.onnx", "tree", "rows", 9, "DISAGREES", 2, 0.25, 0.0, "equal bits", 2, 0.5,
        ("generated row 1: force 2.0: tree answers soft, x.onnx firm",),
    )  # fmt: skip
    found = Agreement("grip", "0" * 64, (wrong,), probes=9)
    assert list(agreement_lines(found)) == [
        "grip: 1 of 1 comparison disagrees (9 generated rows)",
        "compared with  comparisons  largest difference  result",
        "tree           1            0.25                1 DISAGREES",
        "representation  compared with  on    rows  largest difference  allowed  "
        "verdict",
        "x.onnx          tree           rows  9     0.25                0        "
        "DISAGREES in 2 (margin up to 0.5)",
        "x.onnx compared with tree:",
        "  generated row 1: force 2.0: tree answers soft, x.onnx firm",
    ]


def test_certificates_stand_behind_all_the_rest() -> None:
    sentence = "any class can change"
    mixed = Certified(
        "rules in mixed", "mixed", sentence, 1.25e-6, "derived", "data", 178, 9.6e-8,
        2, 1, 3.1e-7, 1, 0, 0, "agrees",
    )  # fmt: skip
    tree = Certified(
        "tree in mixed", "mixed", "the class cannot change", None, "derived", "probes",
        9, None, 0, 1, None, 0, 0, 0, "DISAGREES",
        ("generated row 1: force 2.0: exactly soft",),
    )  # fmt: skip
    found = Agreement("grip", "0" * 64, (), probes=9, certificates=(mixed, tree))
    assert not found.ok
    head, one, other, *said = list(agreement_lines(found, is_verbose=True))[2:]
    flips = "1 (margin up to 3.1e-07), cover lost in 1, gained in 0"
    start = "compared with exact arithmetic  largest error  uncertain              "
    assert head == f"{start}{'changed':{len(flips)}}  verdict    certified"
    start = "rules in mixed                  9.6e-08        2 of 178 rows          "
    assert one == f"{start}{flips}  agrees     {sentence}"
    start = "tree in mixed                   -              0 of 9 generated rows  "
    assert other == f"{start}{'1':{len(flips)}}  DISAGREES  the class cannot change"
    assert said == [
        "tree in mixed compared with exact arithmetic:",
        "  generated row 1: force 2.0: exactly soft",
    ]
    with pytest.raises(DisagreementError) as caught:
        found.raise_if_not_ok()
    assert str(caught.value) == (
        "tree in mixed disagrees with exact arithmetic\n"
        "  generated row 1: force 2.0: exactly soft"
    )


def test_a_graph_that_is_not_written_now_ends_with_1_unless_accepted(
    call: Call,
) -> None:
    proto = onnx.load("grip.onnx")
    proto.graph.initializer.append(numpy_helper.from_array(np.array(13.5), "spare"))
    for entry in proto.metadata_props:
        if entry.key == "fuzzytree.version":
            entry.value = "0.0.1"
    onnx.save(proto, "grip.onnx")
    code, out, _ = call("check", "grip.yaml", "grip.onnx", *NATIVE)
    assert code == 1
    assert "  rows only, 1 difference\n" in out
    detail = "grip.onnx compared with a freshly written graph:\n"
    assert detail + "  constant 'spare' is not the model's: 13.5\n" in out
    said = " comparisons disagrees; in 1 file only the rows agree"
    assert f"{said}, which --rows-only accepts (" in out.splitlines()[0]
    words = ("check", "grip.yaml", "grip.onnx", "--rows-only")
    code, out, _ = call(*words, *NATIVE)
    assert code == 0
    assert f"{said} (" in out.splitlines()[0]
    code, out, _ = call(*words, "--json", *NATIVE)
    facts = json.loads(out)
    assert (code, facts["ok"], facts["rows_only"]) == (0, True, True)
    assert "rows only" in [one["verdict"] for one in facts["comparisons"]]


def test_rows_without_a_bound_stand_apart_from_the_others() -> None:
    known = Comparison("native float32", "native", "rows", 9, "agrees", 0, 1e-5, 2e-5)
    loose = replace(known, unbounded=2, largest_unbounded=0.0069)
    lost = replace(known, unbounded=1, largest_unbounded=math.inf)
    same = replace(known, unbounded=1)
    found = Agreement("grip", "0" * 64, (known, loose, lost, same), probes=9)
    lines = [*agreement_lines(found, is_verbose=True)]
    assert [line.partition("2e-05    ")[2] for line in lines][2:] == [
        "agrees",
        "agrees; 2 rows without a bound differ by up to 0.0069",
        "agrees; 1 row without a bound, some with a missing value on one side only",
        "agrees; 1 row without a bound",
    ]


def test_a_program_is_run_only_if_it_is_the_one_that_is_written_now(
    call: Call,
) -> None:
    ft.save(grip(), "grip.py")
    words = ("check", "grip.yaml", "grip.py", *NATIVE)
    assert call(*words)[0] == 0
    text = Path("grip.py").read_text("utf-8")
    Path("grip.py").write_text(f"{text}\n# a note\n", "utf-8")
    code, out, _ = call(*words)
    assert code == 1
    assert "grip.py compared with a freshly written file:\n  line " in out
    said = "grip.py: its answers: only --run-code runs a file with another text\n"
    assert f"not examined: {said}" in out
    code, out, _ = call(*words, "--run-code")
    assert code == 1
    assert "in 1 file only the rows agree, which --rows-only accepts (" in out
    assert call(*words, "--run-code", "--rows-only")[0] == 0


def test_fixed_point_fails_by_a_changed_constant(call: Call) -> None:
    model = write_model("mamdani")
    assert call("convert", model, "m.c", "--set", "dtype=q15")[0] == 0
    code, out, _ = call("check", model, "m.c", *NATIVE)
    assert (code, "not checked" in out) == (0, False)
    text = Path("m.c").read_text("utf-8")
    Path("m.c").write_text(text.replace("- (24576)", "- (20000)"), "utf-8")
    code, out, _ = call("check", model, "m.c", *NATIVE, "--run-code", "--rows-only")
    assert code == 1
    assert "output 'z' " in out
