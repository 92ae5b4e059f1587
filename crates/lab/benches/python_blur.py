#!/usr/bin/env python3
"""The Python package beside what people blur arrays with: times, and how near each comes to a thin lens.

Needs the package (`python/test` builds it into target/bindings/wheels) and its group `bench`: BlurGenerator, albumentations,
opencv-python-headless.

  python crates/lab/benches/python_blur.py [--size 1280x720] [--seeds 2,5] [--radii 8,16] [--rounds 5] [--samples 96]

Two questions. One radius everywhere: the truth is the picture under an exact disc, area-sampled, in linear light. A radius
for every pixel: the truth is `thin_lens_scene`, an exact thin lens over layers, which shows what things hide. Peers without
such a thing are given it as people do: each of ten ranges of radius is blurred as a whole picture and cut out by a mask.

All get the same picture on the same cores, one after the other, in one run, and give 8-bit sRGB. Times are medians over the
rounds: by the clock, and processor time of all threads. OpenCV blurs codes (`uint8`, as it is mostly used) and linear light
(`float32`, with the conversion to it and back in the time, by a table and by cv2.pow). PSNR is of the 8-bit results.
"""

import argparse
import os
import platform
import statistics
import time
import warnings

import albumentations
import cv2
import numpy as np
from albumentations.augmentations.blur.functional import defocus
from blurgenerator import lens_blur, lens_blur_with_depth_map

import bokehcam as bc

LAYERS = 10


def disc(radius_px, samples=16):
    """Area-sampled disc, sum 1."""
    side = 2 * int(np.ceil(radius_px + 0.5)) + 1
    at = (np.arange(side * samples) + 0.5) / samples - side / 2
    inside = (at[:, None] ** 2 + at[None] ** 2 <= radius_px**2).reshape(side, samples, side, samples)
    kernel = inside.mean((1, 3))
    return (kernel / kernel.sum()).astype(np.float32)


def filter2d(image, radius_px):
    return cv2.filter2D(image, -1, disc(radius_px), borderType=cv2.BORDER_REPLICATE)


def encode(light):
    light = np.clip(light, 0, 1)
    bright = cv2.pow(light, 1 / 2.4) * 1.055 - 0.055
    return (np.where(light <= 0.0031308, light * 12.92, bright) * 255 + 0.5).astype(np.uint8)


def in_light(blur):
    """`blur` of linear light, from codes to codes."""
    return lambda image, *arguments: encode(blur(bc.to_linear(image), *arguments))


def by_layers(blur):
    """`blur` of one radius for each of some ranges of |radius|, cut out by masks."""

    def run(image, coc):
        radii = np.abs(coc)
        edges = np.linspace(0, radii.max() + 1e-3, LAYERS + 1)
        out = np.empty_like(image)
        for low, high in zip(edges, edges[1:]):
            mask = (radii >= low) & (radii < high)
            if mask.any():
                middle = float(radii[mask].mean())
                blurred = blur(image, middle) if middle >= 0.5 else image
                out[mask] = blurred[mask]
        return out

    return run


def with_depth_map(image, coc):
    """BlurGenerator's own: grey 0..255 stands for its radii from 1, the least it has, to the largest."""
    radii = np.abs(coc)
    grey = np.clip(np.round(1 + 254 * radii / radii.max()), 1, 255).astype(np.uint8)
    # The function leaves the darkest grey black: one pixel has it.
    grey[0, 0] = 0
    most = int(np.ceil(radii.max()))
    return lens_blur_with_depth_map(
        image, np.dstack([grey] * 3), components=5, exposure_gamma=2.2, num_layers=LAYERS, min_blur=1, max_blur=most
    )


def measured(run, rounds):
    """The result, and medians by the clock and of processor time in ms, after a round that does not count."""
    result = run()
    clock, processor = [], []
    for _ in range(rounds):
        began = time.perf_counter(), time.process_time()
        run()
        clock.append(time.perf_counter() - began[0])
        processor.append(time.process_time() - began[1])
    return result, statistics.median(clock) * 1e3, statistics.median(processor) * 1e3


def table(title, truth, before, rows, rounds):
    print(f"\n{title} (unblurred: {bc.psnr(before, truth):.1f} dB)\n")
    print("| | clock ms | processor ms | PSNR dB |\n|---|---|---|---|")
    for name, run in rows.items():
        result, clock, processor = measured(run, rounds)
        print(f"| {name} | {clock:.1f} | {processor:.1f} | {bc.psnr(result, truth):.1f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--seeds", default="2,5")
    parser.add_argument("--radii", default="8,16")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--samples", type=int, default=96)
    options = parser.parse_args()
    warnings.filterwarnings("ignore", category=RuntimeWarning)
    size = tuple(int(side) for side in options.size.split("x"))
    cores = len(os.sched_getaffinity(0))
    cv2.setNumThreads(cores)
    print(f"{platform.machine()}, {cores} cores; numpy {np.__version__}, OpenCV {cv2.__version__}, "
          f"albumentations {albumentations.__version__}; {options.size}")

    seeds = [int(seed) for seed in options.seeds.split(",")]
    scenes = {seed: bc.thin_lens_scene(seed, size, samples=options.samples) for seed in seeds}
    opening = bc.disc(rim=0)

    image = scenes[seeds[0]].image_srgb
    out = np.empty_like(image)
    for radius_px in (float(radius) for radius in options.radii.split(",")):
        renderers = {quality: bc.Renderer(size, opening, quality) for quality in ("balanced", "best")}
        rows = {f"bokehcam, `Renderer`, {quality}": lambda r=r: r(image, radius_px, out=out).copy()
                for quality, r in renderers.items()}
        rows |= {
            "bokehcam, `blur`, balanced": lambda: bc.blur(image, radius_px, aperture=opening),
            "OpenCV `filter2D`, linear light": lambda: in_light(filter2d)(image, radius_px),
            "OpenCV `filter2D`, codes": lambda: filter2d(image, radius_px),
            "albumentations `Defocus`, codes": lambda: defocus(image, int(radius_px), 0.1),
            "BlurGenerator `lens_blur`, 5 components, gamma 2.2": lambda: lens_blur(image, radius_px, 5, 2.2),
        }
        truth = encode(filter2d(bc.to_linear(image), radius_px))
        table(f"One radius everywhere: {radius_px:g} px", truth, image, rows, options.rounds)

    for seed, scene in scenes.items():
        image, coc = scene.image_srgb, scene.coc
        renderers = {quality: bc.Renderer(size, opening, quality) for quality in ("draft", "balanced", "best")}
        rows = {f"bokehcam, `Renderer`, {quality}": lambda r=r: r(image, coc, out=out).copy()
                for quality, r in renderers.items()}
        rows |= {
            "bokehcam, `render` from depth, balanced": lambda: bc.render(
                image, scene.depth_m, focus=scene.focus_m, coc_at_infinity=scene.at_infinity_px, aperture=opening),
            "OpenCV `filter2D` by ten masks, linear light": lambda: in_light(by_layers(filter2d))(image, coc),
            "OpenCV `filter2D` by ten masks, codes": lambda: by_layers(filter2d)(image, coc),
            "albumentations `Defocus` by ten masks, codes": lambda: by_layers(
                lambda picture, radius_px: defocus(picture, max(1, round(radius_px)), 0.1))(image, coc),
            "BlurGenerator `lens_blur_with_depth_map`": lambda: with_depth_map(image, coc),
        }
        title = f"A radius for every pixel: scene {seed}, {coc.min():.1f} to {coc.max():.1f} px"
        table(title, scene.truth_srgb, image, rows, options.rounds)


if __name__ == "__main__":
    main()
