#!/usr/bin/env python3
"""Disparity and its time: this project's matcher beside OpenCV's StereoBM and StereoSGBM, in one run.

Needs numpy and opencv-python-headless (python3 -m pip install numpy opencv-python-headless), and a built bokehcam (--bin,
default target/release/bokehcam); pairs with truth are listed in $BOKEHCAM_DATA/stereo/scenes.csv (or --data DIR).

  opencv_stereo.py                        accuracy on those pairs, and on the bundled recording (in no mean)
  opencv_stereo.py --times                the times of the sizes listed below, side by side
  opencv_stereo.py --write-disparity DIR  OpenCV's disparity of the bundled recording's frames, DIR/NAME/NNNNNN.pfm, for
                                          `cargo bench --bench stereo -- picture --rival NAME=DIR/NAME`

Both sides get the same 8-bit grey pair and the same range. OpenCV's parameters are the same for all scenes:
  bm9, bm15             StereoBM: XSOBEL cap 31, texture 10, uniqueness 15, speckle 100 / 32, left-right check 1
  sgbm5, 3way5, hh4_5   StereoSGBM of 5x5: P1 = 8 b^2, P2 = 32 b^2, cap 63, uniqueness 10, speckle 100 / 2, check 1

Scores, in percent of the pixels whose truth is known ("all"), of those that both eyes see ("seen by both", where there is
a mask or a right truth), of those in the leftmost columns that the range takes up ("left strip"), and near depth edges:
  bad-T       the answer is off by more than T px
  holes       of the two readings of a pixel without answer, the one in which it is wrong
  filled      the other one: it takes the nearest answer on its left in the row, else on its right
  avgerr      mean error in px, after filling
  edges       pixels up to 5 columns and rows from a depth edge: neighbours (across or down), both known, whose truth
              differs by more than 1.5 px
  fattening   of those on an edge's far side (the largest truth within 5 px is more than 1.5 px nearer), the share whose
              answer, after filling, is more than 2 px too near and within 2 px of that largest truth
"""
import argparse, csv, json, os, subprocess, sys, tempfile, time
import cv2, numpy as np

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..", ".."))
RECORDING = os.path.join(ROOT, 'recordings', 'stereo')
RECORDING_RANGE = 96
LIMITS = 1, 2, 4
EDGE_PX, EDGE_BAND_PX, OFF_PX = 1.5, 5, 2
EFFORTS = 'full', 'fast'


# The methods: each takes the grey pair and the range, and returns disparities, NaN where unknown.
def block_matching(block):
    def make(disparities):
        matcher = cv2.StereoBM_create(disparities, block)
        matcher.setPreFilterType(cv2.STEREO_BM_PREFILTER_XSOBEL)
        matcher.setPreFilterCap(31)
        matcher.setTextureThreshold(10)
        matcher.setUniquenessRatio(15)
        matcher.setSpeckleWindowSize(100)
        matcher.setSpeckleRange(32)
        matcher.setDisp12MaxDiff(1)
        return matcher
    return make


def semi_global(mode, block=5):
    return lambda disparities: cv2.StereoSGBM_create(
        0, disparities, block, 8 * block ** 2, 32 * block ** 2, disp12MaxDiff=1, preFilterCap=63, uniquenessRatio=10,
        speckleWindowSize=100, speckleRange=2, mode=mode)


OPENCV = {
    'bm9': block_matching(9), 'bm15': block_matching(15),
    'sgbm5': semi_global(cv2.STEREO_SGBM_MODE_SGBM),
    '3way5': semi_global(cv2.STEREO_SGBM_MODE_SGBM_3WAY),
    'hh4_5': semi_global(cv2.STEREO_SGBM_MODE_HH4),
}


def opencv_disparity(name, left, right, disparities):
    out = OPENCV[name](disparities).compute(left, right).astype(np.float32) / 16
    out[out < 0] = np.nan
    return out


def our_disparity(binary, effort, left, right, disparities):
    """left, right: files."""
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, 'disparity.pfm')
        subprocess.run([binary, 'depth', left, right, '--out', out, '--max-disparity', str(disparities), '--effort', effort],
                       check=True, stdout=subprocess.DEVNULL)
        return unknown_is_nan(cv2.imread(out, cv2.IMREAD_UNCHANGED), lambda px: px >= 0)


# Files.
def unknown_is_nan(px, known):
    px = px.astype(np.float32)
    with np.errstate(invalid='ignore'):
        px[~(np.isfinite(px) & known(px))] = np.nan
    return px


def read_truth(path, scale):
    """Disparity in pixels, NaN where unknown."""
    if path.endswith('.npz'):
        box = np.load(path, allow_pickle=False)
        px = box[box.files[0]]
    else:
        px = cv2.imread(path, cv2.IMREAD_UNCHANGED)
        if px is None:
            sys.exit(f'{path}: cannot be read')
        if not path.endswith('.pfm'):
            px = px / np.float32(scale or 256)
    return unknown_is_nan(px, lambda px: px > 0)


def scenes(data):
    """Name, left file, right file, truth, seen by both (or None), range, whether it counts in the mean."""
    listed = os.path.join(data, 'stereo', 'scenes.csv') if data else None
    if listed:
        for row in csv.DictReader(open(listed)):
            at = lambda key: os.path.join(data, 'stereo', row[key])
            scale = float(row['gt_scale'] or 0)
            truth = read_truth(at('gt'), scale)
            seen = None
            if row['mask']:
                seen = cv2.imread(at('mask'), 0) > 127
            elif row['gt_right']:
                seen = seen_by_both(truth, read_truth(at('gt_right'), scale))
            yield row['name'], at('left'), at('right'), truth, seen, int(row['ndisp']), True
    eye = lambda k: os.path.join(RECORDING, f'image_{k}', '000000.png')
    truth = read_truth(os.path.join(RECORDING, 'disp', '000000.png'), 256)
    yield 'portrait', eye(2), eye(3), truth, None, RECORDING_RANGE, False


def seen_by_both(left, right):
    """Left pixels whose truth, carried over, meets a right truth within a pixel."""
    columns = np.rint(np.arange(left.shape[1]) - np.nan_to_num(left)).astype(int)
    inside = np.isfinite(left) & (columns >= 0)
    other = np.take_along_axis(right, np.clip(columns, 0, None), axis=1)
    with np.errstate(invalid='ignore'):
        return inside & (np.abs(other - left) <= 1)


# Scores.
def filled(px):
    known, columns = np.isfinite(px), np.arange(px.shape[1])
    left = np.maximum.accumulate(np.where(known, columns, -1), axis=1)
    right = np.minimum.accumulate(np.where(known, columns, px.shape[1])[:, ::-1], axis=1)[:, ::-1]
    source = np.where(left >= 0, left, np.minimum(right, px.shape[1] - 1))
    return np.nan_to_num(np.take_along_axis(px, source, axis=1))


def edges(truth):
    """Pixels near depth edges, and the largest truth around each pixel."""
    edge = np.zeros(truth.shape, bool)
    with np.errstate(invalid='ignore'):
        across = np.abs(np.diff(truth, axis=1)) > EDGE_PX
        down = np.abs(np.diff(truth, axis=0)) > EDGE_PX
    edge[:, 1:] |= across; edge[:, :-1] |= across; edge[1:] |= down; edge[:-1] |= down
    around = np.ones((2 * EDGE_BAND_PX + 1,) * 2, np.uint8)
    return cv2.dilate(edge.astype(np.uint8), around) > 0, cv2.dilate(np.nan_to_num(truth).astype(np.float32), around)


def percent(wrong, region):
    return float(100 * wrong[region].mean()) if region.any() else None


def score(px, truth, seen, disparities):
    if px.shape != truth.shape:
        sys.exit(f'the answer has {px.shape[1]}x{px.shape[0]} pixels, the truth {truth.shape[1]}x{truth.shape[0]}')
    known = np.isfinite(truth)
    whole = filled(px)
    error = np.abs(whole - truth)
    hole = ~np.isfinite(px)
    strip = known & (np.arange(truth.shape[1]) < disparities)
    out = {'density': percent(~hole, known)}
    for region, counts in ('all', known), ('seen', None if seen is None else known & seen), ('strip', strip):
        if counts is None or not counts.any():
            continue
        out[region] = {f'filled_bad{limit}': percent(error > limit, counts) for limit in LIMITS}
        out[region] |= {f'holes_bad{limit}': percent(hole | (error > limit), counts) for limit in LIMITS}
        out[region]['avgerr'] = float(error[counts].mean())
    band, near = edges(truth)
    band &= known
    with np.errstate(invalid='ignore'):
        far = band & (near - truth > EDGE_PX)
        fat = (whole - truth > OFF_PX) & (np.abs(whole - near) <= OFF_PX)
    out['edges'] = {'filled_bad2': percent(error > 2, band), 'holes_bad2': percent(hole | (error > 2), band),
                    'fattening': percent(fat, far)}
    return out


def accuracy(options):
    methods = list(OPENCV) + [f'ours {effort}' for effort in EFFORTS]
    names, counted, results = [], [], {}
    for name, left, right, truth, seen, disparities, counts in scenes(options.data):
        names.append(name)
        if counts:
            counted.append(name)
        pair = [cv2.imread(path, 0) for path in (left, right)]
        for method in methods:
            if method in OPENCV:
                px = opencv_disparity(method, *pair, disparities)
            else:
                px = our_disparity(options.bin, method.split()[1], left, right, disparities)
            results[name, method] = score(px, truth, seen, disparities)
        print(name, file=sys.stderr)

    def cell(name, method, region, key):
        return results[name, method].get(region, {}).get(key)

    def mean(over, method, region, key):
        values = [cell(name, method, region, key) for name in over]
        return sum(values) / len(values)

    errors = [f'{reading}_bad{limit}' for reading in ('holes', 'filled') for limit in LIMITS] + ['avgerr']
    near_edges = ['holes_bad2', 'filled_bad2', 'fattening']
    for region, title, keys, by_pair in [
            ('all', 'All pixels with known truth', errors, errors),
            ('seen', 'Pixels that both eyes see', errors, ['filled_bad2']),
            ('strip', 'The leftmost columns, as many as the range', errors, ['filled_bad2']),
            ('edges', 'Within 5 px of depth edges', near_edges, near_edges)]:
        rows = [name for name in names if cell(name, methods[0], region, keys[0]) is not None]
        over = [name for name in rows if name in counted]
        if over:
            print(f'\n### {title}: mean of {", ".join(over)}\n')
            table(['method'] + [key.replace('_', ' ') for key in keys],
                  [[method] + [mean(over, method, region, key) for key in keys] for method in methods])
        for key in by_pair:
            if rows:
                print(f'\n### {title}: {key.replace("_", " ")} by pair\n')
                table(['pair'] + methods, [[name] + [cell(name, m, region, key) for m in methods] for name in rows])
    return [{'pair': name, 'method': method, **values} for (name, method), values in results.items()]


def table(head, rows):
    text = lambda value: '-' if value is None else value if isinstance(value, str) else f'{value:.2f}'
    print('| ' + ' | '.join(head) + ' |')
    print('|---' * len(head) + '|')
    for row in rows:
        print('| ' + ' | '.join(text(value) for value in row) + ' |')


# Times.
def sized_pairs(data):
    """Name, grey pair, range."""
    read = lambda *path: cv2.imread(os.path.join(data, 'stereo', *path), 0)
    motorcycle = [read('motorcycle', f'motorcycle_{eye}.png') for eye in ('left', 'right')]
    kitti = [read('kitti2012', f'image_{eye}', '000010_10.png')[:370, :1226] for eye in (0, 1)]

    def cut(width, height):
        scale = max(width / 741, height / 500)
        size = [int(np.ceil(side * scale)) for side in (741, 500)]
        kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
        return [np.ascontiguousarray(cv2.resize(eye, size, interpolation=kind)[:height, :width]) for eye in motorcycle]
    yield 'cones 450x375', [read('cones', 'im2.png'), read('cones', 'im6.png')], 64
    yield '640x480', cut(640, 480), 64
    yield 'Motorcycle 741x500', motorcycle, 64
    yield 'KITTI 1226x370', kitti, 128
    yield '1280x720', cut(1280, 720), 64
    yield '1280x720', cut(1280, 720), 128


def opencv_times(name, pair, disparities, calls):
    matcher = OPENCV[name](disparities)
    matcher.compute(*pair)
    times = []
    for _ in range(calls):
        began = time.perf_counter()
        matcher.compute(*pair)
        times.append(1e3 * (time.perf_counter() - began))
    return times


def our_times(options, files, disparities, threads, calls):
    """Times by effort, measured in the bench's process."""
    lines = subprocess.run(
        [*options.stereo_bench.split(), 'times', *files, '--disparities', str(disparities), '--threads', str(threads),
         '--rounds', str(calls), '--json'], check=True, cwd=ROOT, stdout=subprocess.PIPE, text=True).stdout.splitlines()
    return {f'ours {r["effort"]}': r['times_ms'] for r in map(json.loads, lines)}


def measure_times(options):
    if not options.data:
        sys.exit('--times needs the pairs: name their folder by BOKEHCAM_DATA or --data')
    results = []
    for name, pair, disparities in sized_pairs(options.data):
        for threads in 1, 2:
            times = {}
            cv2.setNumThreads(threads)
            with tempfile.TemporaryDirectory() as folder:
                files = [os.path.join(folder, f'{eye}.png') for eye in ('left', 'right')]
                for path, image in zip(files, pair):
                    cv2.imwrite(path, image)
                for _ in range(options.rounds):
                    for method in OPENCV:
                        times.setdefault(method, []).extend(opencv_times(method, pair, disparities, options.calls))
                    for method, ms in our_times(options, files, disparities, threads, options.calls).items():
                        times.setdefault(method, []).extend(ms)
            results += [{'pair': name, 'disparities': disparities, 'threads': threads, 'method': method,
                         'median_ms': float(np.median(ms)), 'best_ms': min(ms)} for method, ms in times.items()]
            print(name, disparities, threads, file=sys.stderr)
    methods = list(dict.fromkeys(r['method'] for r in results))
    print(f'\n### Milliseconds a pair: median (best) of {options.rounds} x {options.calls}, all methods in turn\n')
    rows = {}
    for r in results:
        row = rows.setdefault((r['pair'], r['disparities'], r['threads']), {})
        row[r['method']] = f'{r["median_ms"]:.1f} ({r["best_ms"]:.1f})'
    table(['pair', 'disparities', 'threads'] + methods,
          [[str(part) for part in key] + [row.get(method) for method in methods] for key, row in rows.items()])
    return results


def write_disparity(folder):
    eye = lambda k, name: cv2.imread(os.path.join(RECORDING, f'image_{k}', name), 0)
    for method in OPENCV:
        os.makedirs(os.path.join(folder, method), exist_ok=True)
        for name in sorted(os.listdir(os.path.join(RECORDING, 'image_2'))):
            px = opencv_disparity(method, eye(2, name), eye(3, name), RECORDING_RANGE)
            # Unknown is infinite, as in the Middlebury benchmark.
            px[np.isnan(px)] = np.inf
            cv2.imwrite(os.path.join(folder, method, name.replace('.png', '.pfm')), px)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--bin', default=os.path.join(ROOT, 'target', 'release', 'bokehcam'), help='this program')
    parser.add_argument('--data', default=os.environ.get('BOKEHCAM_DATA'), help='folder that holds stereo/scenes.csv')
    parser.add_argument('--times', action='store_true', help='measure times instead of accuracy')
    parser.add_argument('--stereo-bench', default='cargo bench -q --bench stereo --', metavar='COMMAND',
                        help='how the bench `stereo` is run')
    parser.add_argument('--rounds', type=int, default=5, help='turns of all methods')
    parser.add_argument('--calls', type=int, default=5, help='pairs matched by a method in its turn')
    parser.add_argument('--write-disparity', metavar='DIR', help="write OpenCV's disparity of the bundled recording")
    parser.add_argument('--json', metavar='FILE', help='write the results there, too')
    options = parser.parse_args()
    if options.write_disparity:
        return write_disparity(options.write_disparity)
    print(f'OpenCV {cv2.__version__}, {os.cpu_count()} cores')
    results = measure_times(options) if options.times else accuracy(options)
    if options.json:
        with open(options.json, 'w') as out:
            json.dump(results, out, indent=1)


if __name__ == '__main__':
    main()
