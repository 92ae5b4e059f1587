"""Writes pictures of a chessboard by two cameras 6 cm apart: boards.py FOLDER."""
import sys, cv2, numpy as np
folder = sys.argv[1]
columns, rows, square, px = 9, 6, 0.025, 40
board = np.full(((rows + 3) * px, (columns + 3) * px), 255, np.uint8)
for y in range(rows + 1):
    for x in range(columns + 1):
        if (x + y) % 2 == 0:
            board[(y + 1) * px:(y + 2) * px, (x + 1) * px:(x + 2) * px] = 0
k = np.array([[600, 0, 319.5], [0, 600, 239.5], [0, 0, 1]], float)
to_m = np.array([[square / px, 0, -6 * square], [0, square / px, -4.5 * square], [0, 0, 1]])
for at in range(10):
    turn, _ = cv2.Rodrigues(np.array([0.3 * np.cos(at), 0.3 * np.sin(at), 0.05 * at]))
    place = np.array([0.06 * np.cos(2 * at), 0.04 * np.sin(3 * at), 0.55 + 0.02 * at])
    for name, shift in (("left", 0.0), ("right", -0.06)):
        pose = np.column_stack([turn[:, 0], turn[:, 1], place + [shift, 0, 0]])
        picture = cv2.warpPerspective(board, k @ pose @ to_m, (640, 480), borderValue=255)
        cv2.imwrite(f"{folder}/{name}{at}.png", picture)
