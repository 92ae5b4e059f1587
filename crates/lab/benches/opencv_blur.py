#!/usr/bin/env python3
"""A uniform disc blur of one picture: this project beside OpenCV's filter2D and rank-4 sums of sepFilter2D.

Needs numpy and opencv-python-headless, and a built bokehcam (--bin, default target/release/bokehcam).

  opencv_blur.py [--image FILE] [--size 1280x720] [--radii 16,32] [--rounds 7] [--quality LEVEL]

Both sides blur in linear light with a hard disc (--rim 0). OpenCV gets float32 linear light and is timed on the filter
alone; bokehcam is timed from 8-bit sRGB to 8-bit sRGB: in `bench`, one frame after another, and live, as the blur stage
of a stream in real time that blurs every frame anew. Every side is timed in turn, in the same run, on one thread and
on two (OpenCV's filters use one whatever is allowed). Nearness to the exact disc: PSNR of the 8-bit results against the
8-bit result of an exact area-sampled disc, and for a lone light on grey the ripple of its plateau and the lowest value
around it, in percent of the plateau's height.
"""
import argparse, json, os, subprocess, sys, tempfile, time
import cv2, numpy as np


def linear(code):
    return np.where(code <= .04045, code / 12.92, ((code + .055) / 1.055) ** 2.4).astype(np.float32)


def srgb8(light):
    light = np.clip(light, 0, 1)
    return (np.where(light <= .0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - .055) * 255 + .5).astype(np.uint8)


def disc(radius_px, samples=16):
    """Area-sampled disc, sum 1."""
    side = 2 * int(np.ceil(radius_px + .5)) + 1
    at = (np.arange(side * samples) + .5) / samples - side / 2
    inside = (at[:, None] ** 2 + at[None] ** 2 <= radius_px ** 2).reshape(side, samples, side, samples)
    kernel = inside.mean((1, 3))
    return (kernel / kernel.sum()).astype(np.float32)


def rank_sum(kernel, rank):
    u, s, v = np.linalg.svd(kernel.astype(np.float64))
    u, s, v = u[:, :rank], s[:rank], v[:rank]
    total = sum(s[t] * u[:, t].sum() * v[t].sum() for t in range(rank))
    pairs = [(v[t].astype(np.float32), (u[:, t] * s[t] / total).astype(np.float32)) for t in range(rank)]

    def run(light):
        out = cv2.sepFilter2D(light, -1, *pairs[0], borderType=cv2.BORDER_REPLICATE)
        for across, down in pairs[1:]:
            cv2.add(out, cv2.sepFilter2D(light, -1, across, down, borderType=cv2.BORDER_REPLICATE), out)
        return out
    return run


def median_ms(run, rounds):
    times = []
    for _ in range(rounds):
        began = time.perf_counter()
        run()
        times.append(time.perf_counter() - began)
    return sorted(times)[rounds // 2] * 1e3


def psnr(a, b):
    return 10 * np.log10(255 ** 2 / max(((a.astype(float) - b) ** 2).mean(), 1e-9))


def render(binary, image, radius_px, quality):
    with tempfile.TemporaryDirectory() as folder:
        source, out = os.path.join(folder, 'in.png'), os.path.join(folder, 'out.png')
        cv2.imwrite(source, image)
        subprocess.run([binary, 'render', source, '--effect', 'blur', '--coc-at-infinity', str(radius_px), '--rim', '0',
                        '--backend', 'cpu', '--quality', quality, '--out', out, '-q'], check=True)
        return cv2.imread(out)


def live_ms(binary, image, radius_px, quality, threads):
    """Median of the blur stage of a stream in real time, without kept parts."""
    with tempfile.TemporaryDirectory() as folder:
        source, report = os.path.join(folder, 'in.png'), os.path.join(folder, 'report.json')
        cv2.imwrite(source, image)
        subprocess.run([binary, 'stream', source, '--effect', 'blur', '--coc-at-infinity', str(radius_px), '--rim', '0',
                        '--backend', 'cpu', '--quality', quality, '--threads', str(threads), '--reuse', 'off', '--pace',
                        'realtime', '--loop', '--frames', '60', '--to', 'null', '--report', report, '-q'], check=True)
        with open(report) as file:
            return json.load(file)['stages_ms']['blur']['p50']


def light_profile(code, background, radius_px):
    """Ripple of the plateau and the lowest value beside it, in percent of the plateau's height over the background."""
    light = linear(code[..., 1].astype(np.float32) / 255) - background
    h, w = light.shape
    y, x = np.mgrid[:h, :w]
    r = np.hypot(x - w // 2, y - h // 2)
    plateau = light[r < .8 * radius_px]
    beside = light[(r > radius_px + 1) & (r < 2.5 * radius_px)]
    height = plateau.mean()
    return 100 * plateau.std() / height, 100 * beside.min() / height


def main():
    args = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    args.add_argument('--image', help='a picture (default: noise of many scales)')
    args.add_argument('--size', default='1280x720')
    args.add_argument('--radii', default='16,32')
    args.add_argument('--rounds', type=int, default=7)
    args.add_argument('--quality', default='balanced')
    args.add_argument('--bin', default='target/release/bokehcam')
    args = args.parse_args()
    w, h = map(int, args.size.split('x'))
    if args.image:
        image = cv2.imread(args.image)
        if image is None:
            sys.exit(f'{args.image}: not a picture that can be read')
        image = cv2.resize(image, (w, h), interpolation=cv2.INTER_AREA)
    else:
        rng = np.random.default_rng(1)
        layers = [cv2.resize(rng.random((4 * 2 ** k * h // w + 2, 4 * 2 ** k, 3)), (w, h), interpolation=cv2.INTER_CUBIC)
                  * .7 ** k for k in range(9)]
        noise = sum(layers)
        image = np.clip((noise - noise.min()) / (noise.max() - noise.min()) * 255, 0, 255).astype(np.uint8)
    light = linear(image.astype(np.float32) / 255)
    for radius_px in map(float, args.radii.split(',')):
        kernel = disc(radius_px)
        low_rank = rank_sum(kernel, 4)
        exact = lambda picture: cv2.filter2D(picture, -1, kernel, borderType=cv2.BORDER_REPLICATE)
        truth = srgb8(exact(light))
        # A single white light on dark grey, 7 px wide so that its disc is bright enough for 8 bits.
        spot = np.full((h, w, 3), 40, np.uint8)
        cv2.circle(spot, (w // 2, h // 2), 5, (255,) * 3, -1)
        spot_light = linear(spot.astype(np.float32) / 255)
        background = float(spot_light[0, 0, 0])
        rows = {}
        for threads in (1, 2):
            cv2.setNumThreads(threads)
            times = {'filter2D': median_ms(lambda: exact(light), args.rounds),
                     'rank-4 sepFilter2D': median_ms(lambda: low_rank(light), args.rounds)}
            bench = [args.bin, 'bench', '--effect', 'blur', '--rim', '0', '--backend', 'cpu', '--sizes', args.size, '--coc',
                     str(radius_px), '--quality', args.quality, '--threads', str(threads), '--frames', '30', '--json']
            times['bokehcam'] = json.loads(subprocess.run(bench, check=True, capture_output=True).stdout)['p50_ms']
            times['bokehcam live'] = live_ms(args.bin, image, radius_px, args.quality, threads)
            for name, ms in times.items():
                rows.setdefault(name, []).append(ms)
        print(f'\nradius {radius_px:g} px, {args.size}, live: {rows["bokehcam live"][0]:.1f} and '
              f'{rows["bokehcam live"][1]:.1f} ms on one and two threads')
        results = {'filter2D': (truth, srgb8(exact(spot_light))),
                   'rank-4 sepFilter2D': (srgb8(low_rank(light)), srgb8(low_rank(spot_light))),
                   'bokehcam': (render(args.bin, image, radius_px, args.quality),
                                render(args.bin, spot, radius_px, args.quality))}
        print(f'radius {radius_px:g} px, {args.size}      1 thread   2 threads   PSNR to exact   ripple   lowest')
        for name, (picture, lone) in results.items():
            ripple, lowest = light_profile(lone, background, radius_px)
            print(f'{name:28s} {rows[name][0]:8.1f} ms {rows[name][1]:8.1f} ms   {psnr(truth, picture):8.1f} dB'
                  f'   {ripple:6.1f} %  {lowest:6.1f} %')
        best = [min(rows['filter2D'][k], rows['rank-4 sepFilter2D'][k]) for k in (0, 1)]
        for name in ('bokehcam', 'bokehcam live'):
            print(f'the better of OpenCV over {name}: {best[0] / rows[name][0]:.1f} times on one thread, '
                  f'{best[1] / rows[name][1]:.1f} on two')


if __name__ == '__main__':
    main()
