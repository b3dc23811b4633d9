"""Cards that move before a textured plane, and what a camera sees of them over an exposure.

Nothing here calls what it is a reference for: a picture is the mean of many instants, each ray met with
each card by its homography. x is right, y down, z away from the camera; lengths are metres.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from potmesil_addon.motion import MotionSettings, expose_layer, prepare
from potmesil_addon.paths import CameraPath, MotionPaths, ObjectPath
from potmesil_addon.progress import run
from potmesil_addon.samples import SampleLayer, Samples, Window
from potmesil_addon.sheets import on_display
from potmesil_addon.shutter import Shutter

from .helpers import Array, Picture

ROWS, COLUMNS = 64, 96
FOCAL = 96.0
MIDDLE = (48.0, 32.0)

Pose = Callable[[Array], Array]
Texture = Callable[[Array, Array], Array]


def waves(color: tuple[float, float, float], period: float, phase: float = 0.0) -> Texture:
    """Return a smooth pattern around a colour, its period in the card's own units."""
    k = 2.0 * math.pi / period

    def texture(u: Array, v: Array) -> Array:
        wave = np.stack([np.sin(k * u + phase), np.sin(k * v + 2.0 * phase), np.sin(0.7 * k * (u + v))], -1)
        return np.asarray(np.array(color) * (1.0 + 0.6 * wave))

    return texture


def plain(color: tuple[float, float, float]) -> Texture:
    """Return one colour."""
    return lambda u, _: np.broadcast_to(np.array(color), (*u.shape, 3))


def pose(
    x: Callable[[Array], Any] = lambda t: 0.0 * t,
    y: Callable[[Array], Any] = lambda t: 0.0 * t,
    z: Callable[[Array], Any] = lambda t: 5.0 + 0.0 * t,
    roll: Callable[[Array], Any] = lambda t: 0.0 * t,
    yaw: Callable[[Array], Any] = lambda t: 0.0 * t,
) -> Pose:
    """Return object to world over time: turned about z, then y, then moved."""

    def at(t: Array) -> Array:
        c, s, zero = np.cos(roll(t)), np.sin(roll(t)), np.zeros_like(t)
        about_z = np.stack([c, -s, zero, s, c, zero, zero, zero, zero + 1.0], -1).reshape(*t.shape, 3, 3)
        c, s = np.cos(yaw(t)), np.sin(yaw(t))
        about_y = np.stack([c, zero, s, zero, zero + 1.0, zero, -s, zero, c], -1).reshape(*t.shape, 3, 3)
        place = np.stack([x(t), y(t), z(t)], -1)
        return np.concatenate([about_y @ about_z, place[..., np.newaxis]], axis=-1)

    return at


@dataclass(frozen=True)
class Card:
    """A flat rectangle; an infinite one with half sizes of inf."""

    pose: Pose
    texture: Texture
    half: tuple[float, float] = (0.6, 0.45)
    index: int = 1
    moves: bool = True


WALL = Card(pose(z=lambda t: 10.0 + 0.0 * t), waves((0.5, 0.45, 0.4), 2.6), (math.inf, math.inf), 0, False)
"""At 10 m, where a pixel is 0.104 m: periods of 25 pixels."""


AT_REST = pose(z=lambda t: 0.0 * t)
"""World to camera of a camera at the origin."""


@dataclass(frozen=True)
class Scene:
    """Cards and a camera over time (world to camera as a pose)."""

    cards: tuple[Card, ...]
    camera: Pose = AT_REST
    camera_moves: bool = False
    rows: int = ROWS
    columns: int = COLUMNS
    focal: float = FOCAL
    middle: tuple[float, float] = MIDDLE

    def camera_at(self, t: Array) -> Array:
        film = np.array([[self.focal, 0.0, self.middle[0]], [0.0, self.focal, self.middle[1]], [0, 0, 1.0]])
        return np.asarray(film @ self.camera(t))


def homography(scene: Scene, card: Card, t: Array) -> Array:
    """Return (..., 3, 3) from the card's (u, v, 1) to pixels times depth."""
    camera, where = scene.camera_at(t), card.pose(t)
    moved = camera[..., :3] @ where
    moved[..., 3] += camera[..., 3]
    return np.asarray(moved[..., [0, 1, 3]])


def seen(
    scene: Scene, t: Array, x: Array, y: Array, cards: tuple[Card, ...] | None = None
) -> tuple[Array, Array, npt.NDArray[np.int32]]:
    """Return premultiplied colour, depth and index along rays at times, all of one shape."""
    shape = np.broadcast_shapes(t.shape, x.shape, y.shape)
    color, depth = np.zeros((*shape, 4)), np.full(shape, np.inf)
    index = np.zeros(shape, dtype=np.int32)
    for card in scene.cards if cards is None else cards:
        back = np.linalg.inv(homography(scene, card, t))
        u, v, w = (back[..., k, 0] * x + back[..., k, 1] * y + back[..., k, 2] for k in range(3))
        # (u, v, 1) z = back (x, y, 1) z: the third row is one over the depth.
        inside = (w > 0.0) & (np.abs(u) <= card.half[0] * w) & (np.abs(v) <= card.half[1] * w)
        with np.errstate(divide="ignore", invalid="ignore"):
            here = np.where(inside, 1.0 / w, np.inf)
            u, v = u / w, v / w
        nearer = here < depth
        color[nearer, :3] = card.texture(u[nearer], v[nearer])
        color[nearer, 3] = 1.0
        depth[nearer] = here[nearer]
        index[nearer] = card.index
    return color, depth, index


def at_instant(
    scene: Scene,
    time: float = 0.0,
    cards: tuple[Card, ...] | None = None,
    *,
    window: Window | None = None,
    corner: bool = False,
    sub: int = 6,
) -> SampleLayer:
    """Return an ordinary render: colours averaged over pixels, depth and index at their middles."""
    window = window or Window(0, 0, scene.columns, scene.rows)
    t = np.array(time)
    inset = 0.0 if corner else 0.5
    extra = 1 if corner else 0
    x = window.x0 + np.arange(window.columns + extra) + inset
    y = window.y0 + np.arange(window.rows + extra)[:, np.newaxis] + inset
    color = np.zeros((*np.broadcast_shapes(x.shape, y.shape), 4))
    offsets = (np.arange(sub) + 0.5) / sub - 0.5
    for dy in offsets:
        for dx in offsets:
            color += seen(scene, t, x + dx, y + dy, cards)[0]
    # A hair off the middle, so that an edge through it is no matter of rounding.
    _, depth, index = seen(scene, t, x + 1e-7, y + 1e-7, cards)
    return SampleLayer("", (color / sub**2).astype(np.float32), depth.astype(np.float32), index)


def paths_of(scene: Scene, keys: Array | None = None) -> MotionPaths:
    """Return what a samples file stores of the scene's motion."""
    keys = np.linspace(-1.0, 1.0, 129) if keys is None else keys
    zero = np.zeros(1)
    camera = CameraPath(keys, scene.camera_at(keys)) if scene.camera_moves else CameraPath(
        zero, scene.camera_at(zero)
    )  # fmt: skip
    objects = tuple(
        ObjectPath(
            f"card {n}", card.index, keys, card.pose(keys),
            np.array([[-card.half[0], -card.half[1], -0.01], [card.half[0], card.half[1], 0.01]]),
        )
        for n, card in enumerate(scene.cards) if card.moves
    )  # fmt: skip
    return MotionPaths(camera, objects)


def vectors_of(scene: Scene, layer: SampleLayer, window: Window | None = None) -> Picture:
    """Return Blender's vector pass: a frame ago at (x + X, y - Y), in the next at (x - Z, y + W), y down."""
    window = window or Window(0, 0, scene.columns, scene.rows)
    x = window.x0 + np.arange(window.columns) + 0.5 + 1e-7
    y = window.y0 + np.arange(window.rows)[:, np.newaxis] + 0.5 + 1e-7
    vector = np.zeros((*layer.color.shape[:2], 4))
    nearest = np.full(layer.color.shape[:2], np.inf)
    now = np.array(0.0)
    for card in scene.cards:
        back = np.linalg.inv(homography(scene, card, now))
        u, v, w = (back[k, 0] * x + back[k, 1] * y + back[k, 2] for k in range(3))
        inside = (w > 0.0) & (np.abs(u) <= card.half[0] * w) & (np.abs(v) <= card.half[1] * w)
        with np.errstate(divide="ignore", invalid="ignore"):
            here = np.where(inside, 1.0 / w, np.inf)
            places = np.stack([u / w, v / w, np.ones_like(u)], -1)
        nearer = here < nearest
        nearest[nearer] = here[nearer]
        for k, time in ((0, -1.0), (2, 1.0)):
            there = places @ homography(scene, card, np.array(time)).T
            off = there[..., :2] / there[..., 2:] - np.stack(np.broadcast_arrays(x, y), -1)
            sign = np.array([1.0, -1.0]) if k == 0 else np.array([-1.0, 1.0])
            vector[nearer, k : k + 2] = (sign * off)[nearer]
    return vector.astype(np.float32)


def samples_of(
    scene: Scene,
    *,
    companions: bool = True,
    paths: bool = True,
    vectors: bool = False,
    window: Window | None = None,
    corner: bool = False,
    **others: Any,
) -> Samples:
    """Return a samples file of the scene at time 0, its display window the scene's."""
    window = window or Window(0, 0, scene.columns, scene.rows)
    layer = at_instant(scene, window=window, corner=corner)
    if companions:
        still = tuple(card for card in scene.cards if not card.moves)
        movers = tuple(card for card in scene.cards if card.moves)
        layer = replace(
            layer,
            stationary=at_instant(scene, cards=still, window=window, corner=corner),
            moving=at_instant(scene, cards=movers, window=window, corner=corner),
        )
    if vectors:
        layer = replace(layer, vector=vectors_of(scene, layer, window))
    extra = 1 if corner else 0
    data = Window(window.x0, window.y0, window.x1 + extra, window.y1 + extra)
    return Samples(
        (layer,),
        data,
        Window(0, 0, scene.columns, scene.rows),
        position="corner" if corner else "center",
        paths=paths_of(scene) if paths else None,
        **others,
    )


def mean_of_instants(
    scene: Scene, times: Callable[[Array, Array, Array], Array], count: int = 400, seed: float = 0.5
) -> Array:
    """Return the exposure, four rays a pixel at each of `count` instants of equal light.

    Parameters
    ----------
    scene : Scene
        The scene.
    times : callable
        Frame times of shares of the light at places x and y of the picture as shares of it.
    count : int
        Instants.
    seed : float
        Where the rays of the first instant lie in their quarters; those of the others follow the golden
        ratios of the plane, so that all places are met.
    """
    n = np.arange(count)
    inner = (seed + np.outer(n, [0.7548776662466927, 0.5698402909980532])) % 1.0
    total = np.zeros((scene.rows, scene.columns, 4))
    for quarter in range(4):
        # Each quarter of a pixel is a quarter of an instant later.
        share = ((n + (quarter + 0.5) / 4.0) / count)[:, np.newaxis, np.newaxis]
        x = np.arange(scene.columns) + (0.5 * (quarter % 2 + inner[:, 0]))[:, np.newaxis, np.newaxis]
        y = (
            np.arange(scene.rows)[:, np.newaxis]
            + (0.5 * (quarter // 2 + inner[:, 1]))[:, np.newaxis, np.newaxis]
        )
        t = times(share, x / scene.columns, y / scene.rows)
        for part in np.array_split(n, max(1, count // 50)):
            at = slice(part[0], part[-1] + 1)
            when = np.broadcast_to(t, (count, *t.shape[1:]))[at]
            total += seen(scene, when, x[at], y[at])[0].sum(axis=0)
    return total / (4 * count)


def even(begin: float, end: float) -> Callable[[Array, Array, Array], Array]:
    """Return the times of a shutter that is open from one frame time to another."""
    return lambda share, _x, _y: begin + share * (end - begin)


def exposed(samples: Samples, shutter: Shutter, **others: Any) -> tuple[Picture, Picture, Any]:
    """Return the motion processor's picture of the first layer, the guessed share, and the report."""
    motion = prepare(samples.layers[0], samples, MotionSettings(shutter, **others))
    assert motion is not None
    return run(expose_layer(motion, samples.layers[0]))


def shown(samples: Samples) -> Picture:
    """Return the picture that the samples are of, at rest."""
    return on_display(samples, samples.layers[0].color)


def decibels(picture: npt.NDArray[Any], reference: npt.NDArray[Any], where: Any = None) -> float:
    """Return the PSNR of the colours (peak 1), over some pixels or all."""
    off = (np.asarray(picture, dtype=np.float64) - reference)[..., :3]
    off = off if where is None else off[where]
    return -10.0 * math.log10(max(float((off**2).mean()), 1e-30))


def swept(scene: Scene, begin: float, end: float) -> npt.NDArray[np.bool_]:
    """Return which pixels a moving card is in at some time of an interval."""
    movers = tuple(card for card in scene.cards if card.moves)
    x, y = np.arange(scene.columns) + 0.5, np.arange(scene.rows)[:, np.newaxis] + 0.5
    t = np.linspace(begin, end, 65)[:, np.newaxis, np.newaxis]
    return np.asarray((seen(scene, t, x, y, movers)[0][..., 3] > 0.0).any(axis=0))


def moving(**motion: Callable[[Array], Any]) -> Scene:
    """Return one card before the wall; at 5 m a pixel is 0.052 m."""
    texture = waves((0.35, 0.6, 0.5), 0.8, 1.0)
    return Scene((WALL, Card(pose(**motion), texture)))


PX = 5.0 / FOCAL
"""A pixel at 5 m."""


@cache
def scene_named(name: str) -> Scene:
    """Return one of the scenes that are compared with brute force."""
    line: dict[str, dict[str, Callable[[Array], Any]]] = {
        "translation": {"x": lambda t: 40.0 * PX * t},
        "diagonal": {"x": lambda t: 30.0 * PX * t, "y": lambda t: -22.0 * PX * t},
        "rotation": {"roll": lambda t: 1.6 * t},
        "acceleration": {"x": lambda t: PX * (30.0 * t + 40.0 * t**2), "y": lambda t: 8.0 * PX * t},
        "approach": {"z": lambda t: 5.0 - 4.0 * t, "x": lambda t: 6.0 * PX * t},
        "curve": {"x": lambda t: 0.9 * np.sin(2.4 * t), "y": lambda t: 0.9 * (1.0 - np.cos(2.4 * t))},
        "yaw": {"yaw": lambda t: 2.6 * t},
        "out of the picture": {"x": lambda t: PX * (38.0 + 40.0 * t)},
    }
    if name in line:
        return moving(**line[name])
    card = moving().cards[1]
    if name == "pan":
        # The world at rest turns in the camera's eyes, the other way round than the camera.
        return Scene(
            (WALL, replace(card, moves=False)), pose(z=lambda t: 0.0 * t, yaw=lambda t: 0.2 * t), True
        )
    if name == "dolly":
        camera = pose(x=lambda t: 1.2 * t, z=lambda t: -1.5 * t)
        return Scene((WALL, replace(card, moves=False, half=(0.8, 0.6))), camera, True)
    if name == "behind a post":
        post = Card(pose(z=lambda t: 3.0 + 0.0 * t), waves((0.6, 0.3, 0.3), 1.0), (0.15625, 5.0), 0, False)
        return Scene((WALL, post, replace(card, pose=pose(x=lambda t: PX * (2.0 + 50.0 * t)))))
    if name == "crossing":
        # Apart in the frame, past each other half a frame later.
        far = Card(pose(lambda t: PX * (60.0 * t - 18.0), lambda t: 8.0 * PX * t), card.texture, (0.4, 0.4))
        near = Card(
            pose(x=lambda t: 3.0 / FOCAL * (18.0 - 60.0 * t), z=lambda t: 3.0 + 0.0 * t),
            waves((0.7, 0.3, 0.2), 0.6), (0.27, 0.36), 2,
        )  # fmt: skip
        return Scene((WALL, far, near))
    raise KeyError(name)
