"""Previews: circles, paths and light of fewer samples, settings as text, and the process beside Blender."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from potmesil_addon import exr, worker
from potmesil_addon.camera import Camera, Film
from potmesil_addon.errors import InputError, SettingsError
from potmesil_addon.focus import average_down
from potmesil_addon.preview import (
    MOST_COLUMNS,
    MOST_ROWS,
    Previewer,
    Tier,
    depth_map,
    least_factor,
    reduced,
    settings_from_json,
    settings_to_json,
)
from potmesil_addon.process import ProcessSettings, process
from potmesil_addon.progress import run
from potmesil_addon.psf import PsfSettings
from potmesil_addon.samples import LensAttributes, PixelFilter, SampleLayer, Samples, Window
from potmesil_addon.shutter import ShutterAttributes, Slit

from .helpers import importable, make_samples, plain_channels, write_exr
from .motion_scenes import samples_of, scene_named

LENS = LensAttributes(0.05, 1.0, 2.0, 0, 0.0, 1.0)
PITCH = 1e-4


def card(rows: int = 48, columns: int = 64, depth: float = 4.0, seed: int = 1, **others: Any) -> Samples:
    """A textured card at one depth."""
    color = np.random.default_rng(seed).random((rows, columns, 4))
    color[..., 3] = 1.0
    film = Film(columns * PITCH, rows * PITCH, columns, rows)
    return make_samples(color, np.full((rows, columns), depth), **{"lens": LENS, "film": film, **others})


# Fewer samples


@pytest.mark.parametrize("factor", [2, 3, 4])
def test_a_reduced_picture_is_the_whole_one_averaged(factor: int) -> None:
    """Waves as long as two circles; tables, integrated over larger pixels, blur them by 2 % more at most."""
    y, x = np.mgrid[0:96, 0:144] + 0.5
    wave = 0.5 + 0.5 * np.sin(2.0 * np.pi * x / 32.0) * np.cos(2.0 * np.pi * y / 32.0)
    color = np.stack([wave, wave, wave, np.ones_like(wave)], axis=2)
    lens = replace(LENS, f_stop=0.4)
    samples = make_samples(color, 4.0, lens=lens, film=Film(144 * PITCH, 96 * PITCH, 144, 96))
    settings = ProcessSettings(visibility="none")
    whole = average_down(run(process(samples, settings)).picture, factor)
    small = run(process(reduced(samples, factor), settings)).picture
    assert small.shape == whole.shape
    # At the border circles are cut off, which squares know less of.
    edge = 24 // factor
    inside = (slice(edge, -edge), slice(edge, -edge))
    assert np.abs(small - whole)[inside].max() < 0.02
    # A film that did not shrink along would blur more.
    wrong = replace(reduced(samples, factor), film=samples.film)
    assert np.abs(run(process(wrong, settings)).picture - whole)[inside].max() > 0.05


def test_circles_shrink_with_the_squares() -> None:
    samples = card()
    for factor in (2, 4):
        report = run(process(reduced(samples, factor), ProcessSettings(visibility="none"))).report
        circle = report["focus"][0]["farthest_circle_px"]
        # c = (F^2 / n) (P - D) / (P D)
        assert circle == pytest.approx(0.05**2 * 2.0 / 8.0 / PITCH / factor, rel=1e-6)


def test_colours_keep_their_light_and_depths_are_of_samples() -> None:
    rng = np.random.default_rng(5)
    color, depth = rng.random((12, 18, 4)), rng.uniform(1.0, 9.0, (12, 18))
    small = reduced(make_samples(color, depth), 3).layers[0]
    squares = color.reshape(4, 3, 6, 3, 4)
    np.testing.assert_allclose(small.color, squares.mean(axis=(1, 3)), rtol=1e-6)
    assert small.depth is not None
    middle = np.median(depth.reshape(4, 3, 6, 3).transpose(0, 2, 1, 3).reshape(4, 6, 9), axis=2)
    np.testing.assert_array_equal(small.depth, middle.astype(np.float32))


def test_index_and_vector_belong_to_the_same_sample_as_the_depth() -> None:
    rng = np.random.default_rng(6)
    depth = rng.permutation(64).reshape(8, 8).astype(np.float32) + 1.0
    index = depth.astype(np.int32) * 10
    vector = np.repeat(depth[..., np.newaxis], 4, axis=2)
    layer = SampleLayer("", np.ones((8, 8, 4), np.float32), depth, index, vector, hidden=())
    hidden = replace(layer, depth=depth + 100.0)
    window = Window(0, 0, 8, 8)
    small = reduced(Samples((replace(layer, hidden=(hidden,)),), window, window), 2).layers[0]
    assert small.depth is not None
    assert small.object_index is not None
    assert small.vector is not None
    np.testing.assert_array_equal(small.object_index, small.depth.astype(np.int32) * 10)
    np.testing.assert_array_equal(small.vector[..., 2], small.depth / 2.0)
    (behind,) = small.hidden
    assert behind.depth is not None
    np.testing.assert_array_equal(behind.depth, small.depth + 100.0)


@pytest.mark.parametrize(("x0", "y0"), [(0, 0), (-5, -3), (-4, -4), (3, 1)])
@pytest.mark.parametrize("factor", [2, 3])
def test_squares_lie_on_the_pictures_grid(x0: int, y0: int, factor: int) -> None:
    """Each sample's colour is its own place, in the picture's pixels."""
    data = Window(x0, y0, x0 + 40, y0 + 31)
    x, y = np.meshgrid(np.arange(data.x0, data.x1) + 0.5, np.arange(data.y0, data.y1) + 0.5)
    color = np.stack([x, y, 0.0 * x, 0.0 * x + 1.0], axis=2).astype(np.float32)
    layer = SampleLayer("", color, np.ones(color.shape[:2], np.float32))
    small = reduced(Samples((layer,), data, Window(0, 0, 30, 26)), factor)
    assert small.display_window == Window(0, 0, 30 // factor, 26 // factor)
    window = small.data_window
    assert small.layers[0].color.shape[:2] == (window.rows, window.columns)
    centers = factor * (np.arange(window.x0, window.x1) + 0.5)
    np.testing.assert_allclose(small.layers[0].color[0, :, 0], centers)
    np.testing.assert_allclose(
        small.layers[0].color[:, 0, 1], factor * (np.arange(window.y0, window.y1) + 0.5)
    )


def test_corner_samples_stay_at_corners() -> None:
    y, x = np.mgrid[0:13, 0:17].astype(np.float32)
    color = np.stack([x, y, 0 * x, 0 * x + 1], axis=2)
    layer = SampleLayer("", color, np.ones((13, 17), np.float32))
    window = Window(0, 0, 17, 13)
    small = reduced(Samples((layer,), window, Window(0, 0, 16, 12), position="corner"), 4)
    assert (small.data_window, small.display_window) == (Window(0, 0, 5, 4), Window(0, 0, 4, 3))
    np.testing.assert_array_equal(small.layers[0].color[0, :, 0], [0, 4, 8, 12, 16])


def test_the_camera_sees_the_same_points() -> None:
    camera = Camera(np.eye(4), 0.05, Film(0.036, 0.024, 60, 40), 31.5, 18.25)
    samples = replace(card(40, 60), camera=camera)
    small = reduced(samples, 4).camera
    assert small is not None
    points = np.array([[0.1, 0.2, -3.0], [-0.3, 0.1, -7.0]])
    np.testing.assert_allclose(small.project(points)[0], camera.project(points)[0] / 4.0, rtol=1e-12)


def test_fine_samples_become_pixels() -> None:
    small = reduced(card(supersampling=2, pixel_filter=PixelFilter(0.4, 0.3)), 2)
    assert small.supersampling == 1
    assert small.pixel_filter is None
    assert small.mixes_surfaces


def test_a_factor_of_one_changes_nothing() -> None:
    samples = card()
    assert reduced(samples, 1) is samples


def test_a_picture_never_vanishes() -> None:
    window = reduced(card(3, 5), 8).display_window
    assert (window.columns, window.rows) == (1, 1)


@pytest.mark.parametrize(
    ("columns", "rows", "factor"),
    [(960, 540, 1), (961, 540, 2), (1920, 1080, 2), (3840, 2160, 4), (540, 960, 2), (100, 50, 1)],
)
def test_previews_fit_their_size(columns: int, rows: int, factor: int) -> None:
    window = Window(0, 0, columns, rows)
    assert least_factor(Samples((), window, window)) == factor
    assert columns // factor <= MOST_COLUMNS
    assert rows // factor <= MOST_ROWS


# Settings as text


@pytest.mark.parametrize(
    "settings",
    [
        ProcessSettings(),
        ProcessSettings(
            use_lens=False,
            lens=LensAttributes(0.05, 1.4, math.inf, 6, 0.5, 2.0),
            shutter=ShutterAttributes(
                0.02,
                24.0,
                0.5,
                "start",
                ((0.0, 1.0), (1.0, 0.0)),
                ((0.0, 0.2), (0.5, 0.7)),
                0.1,
                Slit("left"),
            ),
            motion_model="vector",
            sensor_width=0.03,
            model="paper",
            psf=PsfSettings("lommel", step=0.5, wavelengths=(6e-7, 5e-7, 4e-7)),
            weighting="1981",
            visibility="none",
            uniform_defocus=1e-4,
            fade=0.5,
            backend="numpy",
        ),
    ],
)
def test_settings_survive_as_text(settings: ProcessSettings) -> None:
    text = json.dumps(settings_to_json(settings))
    assert settings_from_json(json.loads(text)) == settings


def test_what_no_text_says_is_the_default() -> None:
    assert settings_from_json({"psf": {"kind": "lommel"}}) == ProcessSettings(psf=PsfSettings("lommel"))


def test_wrong_settings_are_refused() -> None:
    with pytest.raises(SettingsError, match="Fade"):
        settings_from_json({"fade": -1.0})


# As good as there is time for


def test_a_preview_without_motion_is_the_processors_picture() -> None:
    samples, settings = card(64, 96), ProcessSettings(use_motion=False)
    for tier in Previewer(samples).tiers(settings):
        expected = run(process(reduced(samples, tier.factor), replace(settings, visibility=tier.visibility)))
        np.testing.assert_allclose(
            Previewer(samples).picture_at(settings, tier), expected.picture, rtol=1e-5, atol=1e-6
        )


def test_kinds_are_ordered_from_the_best() -> None:
    found = Previewer(card(128, 128)).tiers(ProcessSettings())
    assert found[:3] == [Tier(1, "aperture"), Tier(1, "none"), Tier(2, "aperture")]
    plain_kinds = Previewer(card(128, 128)).tiers(ProcessSettings(use_lens=False))
    assert {tier.visibility for tier in plain_kinds} == {"none"}


class Clock:
    """Time that passes as a preview's kind says."""

    def __init__(self, previewer: Previewer, seconds: Callable[[Tier], float]) -> None:
        self.now, self.seconds, self.previewer = 0.0, seconds, previewer

    def perf_counter(self) -> float:
        return self.now

    def picture_at(self, _: ProcessSettings, tier: Tier) -> np.ndarray[Any, Any]:
        self.now += self.seconds(tier)
        return np.zeros((1, 1, 4), np.float32)


def drag(monkeypatch: pytest.MonkeyPatch, seconds: Callable[[Tier], float], number: int = 60) -> list[Tier]:
    previewer = Previewer(card(256, 256), budget=0.06)
    clock = Clock(previewer, seconds)
    monkeypatch.setattr("potmesil_addon.preview.time", clock)
    monkeypatch.setattr(previewer, "picture_at", clock.picture_at)
    return [previewer.picture(ProcessSettings())[1] for _ in range(number)]


def test_a_fast_machine_gets_the_best(monkeypatch: pytest.MonkeyPatch) -> None:
    assert drag(monkeypatch, lambda _: 0.001)[-1] == Tier(1, "aperture")


def test_a_slow_one_gets_the_smallest_and_simplest(monkeypatch: pytest.MonkeyPatch) -> None:
    assert drag(monkeypatch, lambda _: 1.0)[-1] == Tier(8, "none", motion=False)


def test_where_motion_takes_too_long_it_is_left_out_while_the_hand_moves(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen = drag(monkeypatch, lambda tier: 0.5 if tier.motion else 0.02)
    assert not any(tier.motion for tier in seen[3:])
    # Within three steps: ten times too slow is three down.
    assert [tier.motion for tier in seen[:4]].count(True) <= 3


def test_previews_keep_to_their_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each kind takes three times as long as the next; after the search it does not go up and down."""
    ladder = Previewer(card(256, 256)).tiers(ProcessSettings())
    taken = {tier: 0.5 / 3.0**n for n, tier in enumerate(ladder)}
    seen = drag(monkeypatch, taken.__getitem__)
    assert all(taken[tier] <= 0.06 for tier in seen[8:])
    assert len(set(seen[8:])) == 1
    assert taken[seen[-1]] > 0.06 / 4.0 / 3.0


def moving_card() -> tuple[Samples, ProcessSettings]:
    settings = ProcessSettings(use_lens=False, shutter=ShutterAttributes(frames=1.0))
    return samples_of(scene_named("translation")), settings


@pytest.mark.parametrize("factor", [1, 2])
def test_a_preview_shows_the_motion(factor: int) -> None:
    samples, settings = moving_card()
    previewer = Previewer(samples)
    moved = previewer.picture_at(settings, Tier(factor, "none"))
    still = previewer.picture_at(replace(settings, use_motion=False), Tier(factor, "none"))
    whole = average_down(run(process(samples, settings)).picture, factor)
    error = float(np.sqrt(np.mean((moved - whole) ** 2)))
    assert error < 0.5 * float(np.sqrt(np.mean((still - whole) ** 2)))


def test_another_shutter_is_not_the_last_ones() -> None:
    samples, settings = moving_card()
    previewer = Previewer(samples)
    long = previewer.picture_at(settings, Tier(1, "none"))
    short = previewer.picture_at(replace(settings, shutter=ShutterAttributes(frames=0.1)), Tier(1, "none"))
    assert np.abs(long - short).max() > 0.1
    np.testing.assert_array_equal(previewer.picture_at(settings, Tier(1, "none")), long)


def test_a_file_without_depth_is_refused_as_always() -> None:
    window = Window(0, 0, 32, 32)
    samples = Samples((SampleLayer("", np.ones((32, 32, 4), np.float32)),), window, window, lens=LENS)
    samples = replace(samples, film=Film(0.036, 0.036, 32, 32))
    with pytest.raises(InputError, match="depth"):
        Previewer(samples).picture(ProcessSettings())


def test_depths_are_of_what_is_seen_first() -> None:
    window, data = Window(0, 0, 4, 3), Window(1, 0, 6, 3)
    near = np.full((3, 5), 2.0, np.float32)
    clear = np.zeros((3, 5, 4), np.float32)
    half = clear.copy()
    half[:, :2, 3] = 1.0
    layers = (SampleLayer("far", clear + 1.0, near + 3.0), SampleLayer("near", half, near))
    found = depth_map(Samples(layers, data, window))
    np.testing.assert_array_equal(found, np.tile(np.float32([np.inf, 2.0, 2.0, 5.0]), (3, 1)))


# The process beside Blender


class Talk:
    """A worker in a process of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.outbox = worker.Outbox(folder / worker.REQUESTS)
        self.inbox = worker.Inbox(folder / worker.REPLIES)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "potmesil_addon.worker", str(folder), os.environ["NUMBA_CACHE_DIR"]],
            env=importable(),
            cwd=folder,
        )
        self.seen: list[dict[str, Any]] = []

    def wait(self, done: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        heard = time.monotonic()
        until = heard + 300.0
        while time.monotonic() < until and self.process.poll() is None:
            for line in self.inbox.lines():
                self.seen.append(json.loads(line))
                if done(self.seen[-1]):
                    return self.seen[-1]
            # A worker that hears nothing for a minute goes, and compiling takes longer on a busy machine.
            if time.monotonic() > heard + 1.0:
                heard = time.monotonic()
                self.outbox.send()
            time.sleep(0.01)
        raise AssertionError(f"no such reply; it said {self.seen}")

    def picture(self, reply: dict[str, Any]) -> np.ndarray[Any, Any]:
        values = np.fromfile(self.folder / reply["picture"], dtype=np.float32)
        return values.reshape(reply["shape"])


@pytest.fixture
def talk(tmp_path: Path) -> Iterator[Talk]:
    folder = tmp_path / "talk"
    folder.mkdir()
    found = Talk(folder)
    yield found
    found.process.kill()
    found.process.wait()
    found.outbox.close()
    found.inbox.close()


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return write_exr(tmp_path / "samples.exr", plain_channels(24, 32))


def request(path: Path, kind: str, number: int, **settings: Any) -> dict[str, Any]:
    wanted = settings_to_json(
        ProcessSettings(lens=LensAttributes(0.05, 2.0, 3.0), sensor_width=0.036, use_motion=False, **settings)
    )
    return {"kind": kind, "id": number, "path": str(path), "stamp": [1, 2], "settings": wanted}


def test_a_worker_makes_previews_and_the_whole_picture(talk: Talk, file: Path) -> None:
    talk.outbox.send(request(file, "preview", 1))
    reply = talk.wait(lambda r: r.get("id") == 1)
    factor = reply["tier"][0]
    assert talk.picture(reply).shape == (24 // factor, 32 // factor, 4)
    (told,) = (r for r in talk.seen if "depth" in r)
    depth = np.fromfile(talk.folder / told["depth"], dtype=np.float32).reshape(told["shape"])
    samples = exr.read_samples(file)
    np.testing.assert_array_equal(depth, depth_map(samples))
    asked = request(file, "full", 2)
    # Here first: what this compiles, the worker has not to.
    expected = run(process(samples, settings_from_json(asked["settings"])))
    talk.outbox.send(asked)
    whole = talk.wait(lambda r: r.get("id") == 2)
    np.testing.assert_array_equal(talk.picture(whole), expected.picture)
    assert whole["quality"] == expected.report["quality"]
    assert not [r for r in talk.seen[talk.seen.index(reply) :] if "compiling" in r]
    talk.outbox.send({"kind": "end", "id": 3})
    assert talk.process.wait(timeout=20.0) == 0


def test_a_worker_says_what_is_wrong_and_goes_on(talk: Talk, file: Path) -> None:
    missing = file.with_name("missing.exr")
    talk.outbox.send(request(missing, "preview", 1))
    assert "missing.exr" in talk.wait(lambda r: r.get("id") == 1)["error"]
    talk.outbox.send(request(file, "preview", 2))
    assert "picture" in talk.wait(lambda r: r.get("id") == 2)


def test_only_the_newest_request_is_answered(talk: Talk, file: Path) -> None:
    for number in range(1, 6):
        talk.outbox.send(request(file, "full", number, fade=number / 10.0))
    talk.wait(lambda r: r.get("id") == 5)
    # The first may have been finished before the second came.
    assert [r["id"] for r in talk.seen if "id" in r][-1] == 5
    assert len([r for r in talk.seen if "id" in r]) <= 2


def test_lines_are_taken_when_they_are_complete(tmp_path: Path) -> None:
    inbox = worker.Inbox(tmp_path / "lines")
    with (tmp_path / "lines").open("ab", buffering=0) as out:
        assert inbox.lines() == []
        out.write(b"one\ntw")
        assert inbox.lines() == [b"one"]
        out.write(b"o\n\n")
        assert inbox.lines() == [b"two", b""]
    inbox.close()


def test_a_worker_left_alone_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "SILENCE", 0.1)
    folder = tmp_path / "talk"
    folder.mkdir()
    worker.Worker(folder).run()
    assert not folder.exists()


def test_a_worker_needs_a_folder(capsys: pytest.CaptureFixture[str]) -> None:
    assert worker.main([]) == 2
    assert "FOLDER" in capsys.readouterr().err


def test_a_worker_tells_of_what_it_compiles(
    tmp_path: Path, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "empty"))
    (tmp_path / "talk").mkdir()
    talk = Talk(tmp_path / "talk")
    talk.outbox.send(request(file, "full", 1, visibility="none"))
    talk.wait(lambda r: "compiling" in r)
    talk.process.kill()
    talk.process.wait()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no process gets a new parent here")
def test_a_worker_ends_with_the_process_that_started_it(tmp_path: Path) -> None:
    (tmp_path / "talk").mkdir()
    start = (
        "import subprocess, sys, time\n"
        "subprocess.Popen([sys.executable, '-m', 'potmesil_addon.worker', sys.argv[1]])\n"
        "time.sleep(600)"
    )
    parent = subprocess.Popen([sys.executable, "-c", start, str(tmp_path / "talk")], env=importable())
    replies = tmp_path / "talk" / worker.REPLIES
    until = time.monotonic() + 60.0
    while not (replies.exists() and b"ready" in replies.read_bytes()) and time.monotonic() < until:
        time.sleep(0.05)
    assert replies.exists()
    parent.kill()
    parent.wait()
    while replies.parent.exists() and time.monotonic() < until:
        time.sleep(0.05)
    assert not replies.parent.exists()


def test_a_worker_that_is_told_to_end_leaves_the_folder_alone(tmp_path: Path) -> None:
    outbox = worker.Outbox(tmp_path / worker.REQUESTS)
    outbox.send({"kind": "end", "id": 1})
    outbox.close()
    worker.Worker(tmp_path).run()
    assert (tmp_path / worker.REPLIES).exists()
