"""The planner's arithmetic, and that the page's numbers are its own."""

from __future__ import annotations

import re
import shlex
from dataclasses import replace
from pathlib import Path

import pytest

from farm import plan

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "farm_planning.md"

SIMPLE = plan.Animation(
    frames=1000,
    workers=10,
    chunk=10,
    pixels=1_000_000,
    render_s=100.0,
    process_s=4.0,
    start_s=10.0,
    cold_s=50.0,
    samples_bytes=30.0,
    picture_bytes=10.0,
    scene_bytes=5e6,
    hours_between_failures=29.0,
    failing=0.01,
)


def test_work_of_a_stage() -> None:
    assert SIMPLE.tasks == 100
    assert SIMPLE.busy_s("passes") == 1000 * 100 + 100 * 10
    # Ten workers compile kernels once each.
    assert SIMPLE.busy_s("process") == 1000 * 4 + 100 * 10 + 10 * 50
    assert replace(SIMPLE, frames=1001).tasks == 101


def test_hours_are_shared_work_and_half_a_task() -> None:
    assert SIMPLE.hours("passes") == pytest.approx((101_000 / 10 + 0.5 * 1010) / 3600)
    # More workers than tasks are of no use.
    assert replace(SIMPLE, workers=500).hours("passes") == pytest.approx((101_000 / 100 + 505) / 3600)


def test_network_at_the_file_server() -> None:
    # A frame every 5 seconds on each of ten workers: 4 of work and a tenth of a start.
    assert SIMPLE.frames_a_second("process") == pytest.approx(2.0)
    assert SIMPLE.read_s() == pytest.approx(2.0 * (30e6 + 0.5e6))
    assert SIMPLE.written_s("process") == pytest.approx(2.0 * 10e6)
    assert SIMPLE.written_s("passes") == pytest.approx(10 / 101 * 30e6)


def test_workers_that_a_server_feeds() -> None:
    assert SIMPLE.workers_for(30.5e6) == 5
    assert SIMPLE.workers_for(1e12) == 10


def test_failures() -> None:
    # 106,500 s of work in all.
    assert SIMPLE.lost_workers == pytest.approx(106_500 / 3600 / 29)
    lost = SIMPLE.lost_workers * (50 + 10) + 10 * 104
    assert SIMPLE.lost_s == pytest.approx(lost)


def test_table_adds_up(capsys: pytest.CaptureFixture[str]) -> None:
    words = (
        "--frames 1000 --workers 10 --chunk 10 --size 1000x1000 --render 100 --process 4 --start 10 --cold 50"
    )
    assert plan.main([*words.split(), "--samples-bytes", "30", "--server", "0.0305", "--array", "30"]) == 0
    rows = dict(re.split(r"  +", line.strip(), maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert rows["Work of all workers"] == "30 h"
    assert rows["of which rendering"] == "93.9 %"
    assert rows["Arrays of 30"] == "4"
    assert rows["All samples files"] == "0.03 TB"
    assert rows["Workers that 0.0305 GB/s feed with samples"] == "3"
    # Ten workers: 100 + 4 + a tenth of 10 seconds for 30 + 12 MB.
    assert rows["Written by both stages in one task"] == "4 MB/s"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--render", "0", "--process", "1"], "must be more than 0"),
        (["--render", "1", "--process", "nan"], "must be a number"),
        (["--render", "1", "--process", "1", "--size", "4K"], "'4K' is no size; write it as 1920x1080."),
        (["--render", "1", "--process", "1", "--workers", "0"], "must be a whole number of 1 or more"),
    ],
)
def test_what_is_wrong_is_said(words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        plan.main(words)
    assert ended.value.code == 2
    assert sentence in capsys.readouterr().err


def test_page_shows_what_the_program_prints(capsys: pytest.CaptureFixture[str]) -> None:
    found = re.findall(r"^    python farm/plan\.py (.*)\n\n((?:    .*\n)+)", PAGE.read_text(), re.MULTILINE)
    assert len(found) == 2
    for words, printed in found:
        plan.main(shlex.split(words))
        lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
        assert [line.strip() for line in printed.splitlines()] == lines
