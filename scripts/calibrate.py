#!/usr/bin/env python3
"""Calibrates two cameras from pictures of a chessboard, with OpenCV, into a file that bokehcam reads.

    scripts/calibrate.py --corners 9x6 --square-mm 25 --out stereo.yml --left left*.jpg --right right*.jpg
    scripts/calibrate.py --corners 9x6 --square-mm 25 --out stereo.yml --side-by-side shot*.png

Print a chessboard, glue it onto something flat, and take 15 to 30 pairs with it in every part of the picture, tilted
this way and that; both cameras must see all of it, and neither may move between the pictures of a pair. `--corners`
counts the inner corners, along rows and columns.

Needs `pip install opencv-python-headless` (4.5 or later).
"""
import argparse
import os
import sys

import cv2
import numpy as np

MIN_PAIRS = 8


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corners", required=True, metavar="COLUMNSxROWS", help="inner corners of the board")
    parser.add_argument("--square-mm", required=True, type=float, help="side of one square, in millimetres")
    parser.add_argument("--out", required=True, help="the file to write, such as stereo.yml")
    parser.add_argument("--left", nargs="+", default=[], metavar="PICTURE", help="pictures of the left camera")
    parser.add_argument("--right", nargs="+", default=[], metavar="PICTURE", help="those of the right one, in order")
    parser.add_argument("--side-by-side", nargs="+", default=[], metavar="PICTURE", help="pictures of both at once")
    args = parser.parse_args()
    try:
        args.board = tuple(int(side) for side in args.corners.lower().split("x"))
        assert len(args.board) == 2 and min(args.board) > 2
    except (ValueError, AssertionError):
        parser.error(f"--corners {args.corners}: give inner corners along rows and columns, such as 9x6")
    if args.square_mm <= 0:
        parser.error("--square-mm must be above 0")
    if len(args.left) != len(args.right):
        parser.error(f"{len(args.left)} left pictures and {len(args.right)} right ones do not make pairs")
    return args


def read(path):
    picture = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
    if picture is None:
        sys.exit(f"{path}: cannot be read as a picture")
    return picture


def pairs(args):
    for left, right in zip(sorted(args.left), sorted(args.right)):
        yield f"{left}, {right}", read(left), read(right)
    for both in sorted(args.side_by_side):
        picture = read(both)
        half = picture.shape[1] // 2
        yield both, picture[:, :half], picture[:, half : 2 * half]


def corners(picture, board):
    found, points = cv2.findChessboardCornersSB(picture, board, flags=cv2.CALIB_CB_ACCURACY)
    return points.reshape(-1, 1, 2) if found else None


def main():
    args = arguments()
    columns, rows = args.board
    square = np.zeros((columns * rows, 3), np.float32)
    square[:, :2] = np.mgrid[:columns, :rows].T.reshape(-1, 2) * args.square_mm / 1000

    seen, size = [], None
    for name, *pictures in pairs(args):
        for picture in pictures:
            size = size or picture.shape[::-1]
            if picture.shape[::-1] != size:
                sys.exit(f"{name}: {picture.shape[1]}x{picture.shape[0]}, and the first one was {size[0]}x{size[1]}")
        points = [corners(picture, args.board) for picture in pictures]
        if any(found is None for found in points):
            print(f"left out, as the board was not found in both: {name}", file=sys.stderr)
        else:
            seen.append(points)
    if len(seen) < MIN_PAIRS:
        sys.exit(f"the board was found in {len(seen)} pairs, and {MIN_PAIRS} are needed: take more, and check --corners")

    boards = [square] * len(seen)
    left, right = [[points[camera] for points in seen] for camera in (0, 1)]
    rms_left, m1, d1, _, _ = cv2.calibrateCamera(boards, left, size, None, None)
    rms_right, m2, d2, _, _ = cv2.calibrateCamera(boards, right, size, None, None)
    rms, m1, d1, m2, d2, r, t, _, _ = cv2.stereoCalibrate(
        boards, left, right, m1, d1, m2, d2, size, flags=cv2.CALIB_USE_INTRINSIC_GUESS
    )
    r1, r2, p1, p2 = cv2.stereoRectify(m1, d1, m2, d2, size, r, t)[:4]
    level = [
        cv2.undistortPoints(np.concatenate(points), m, d, R=turn, P=p)[:, 0, 1]
        for points, m, d, turn, p in ((left, m1, d1, r1, p1), (right, m2, d2, r2, p2))
    ]
    print(
        f"{len(seen)} pairs of {size[0]}x{size[1]}; RMS of left {rms_left:.3f}, right {rms_right:.3f}, both {rms:.3f} px; "
        f"rows agree within {np.mean(np.abs(level[0] - level[1])):.3f} px; baseline {np.linalg.norm(t) * 1000:.1f} mm"
    )
    if rms > 1:
        print("the RMS error is too large: leave out blurred pictures, and check that the board is flat", file=sys.stderr)
    if t[0, 0] > 0:
        swap = "the halves of the pictures" if args.side_by_side else "--left and --right"
        sys.exit(f"the left camera stands on the right: swap {swap}; {args.out} is not written")

    # A calibration that is there is replaced by a whole one only.
    folder, name = os.path.split(args.out)
    part = os.path.join(folder, f".part-{name}")
    file = cv2.FileStorage(part, cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_FORMAT_YAML)
    if not file.isOpened():
        sys.exit(f"{args.out}: cannot be written")
    file.write("image_width", size[0])
    file.write("image_height", size[1])
    for key, value in (("M1", m1), ("D1", d1), ("M2", m2), ("D2", d2), ("R", r), ("T", t)):
        file.write(key, value)
    file.release()
    os.replace(part, args.out)
    print(f"wrote {args.out}; T is in metres")


main()
