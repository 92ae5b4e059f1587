// Included by the tracing passes: hysteresis as in edge tracing (Canny), from entries with some alpha, though the map
// is far there, to their neighbours. The passes bind `metres`, `places`, `cells` and `counts`.
// twin: src/depth/matting/trace.rs

const ALL_DIRECTIONS = (1u << DIRECTIONS) - 1u;

// Bit position of a step's claims in `places`: even and odd steps alternate.
fn claim_shift(step: u32) -> u32 {
    return DIRECTIONS * (step % 2u);
}

// Claims the neighbours of a pixel for the next step, if they are as far as its far surface. Skips those of this step,
// and those that already have an entry.
fn claim_neighbours(at: u32, far: f32, step: u32) {
    let pixel = vec2(at % frame.size.x, at / frame.size.x);
    let taken = ENTERED | (ALL_DIRECTIONS << claim_shift(step));
    let next = claim_shift(step + 1u);
    for (var k = 0u; k < DIRECTIONS; k++) {
        // At the first column or row, the subtraction wraps, so that the check below fails.
        let other = pixel + vec2(k % 3u, k / 3u) - 1u;
        if k == DIRECTIONS / 2u || any(other >= frame.size) {
            continue;
        }
        let place = other.y * frame.size.x + other.x;
        if (atomicLoad(&places[place]) & taken) != 0u || abs(inverse_depth(metres[place]) - far) > frame.depth_step {
            continue;
        }
        // Seen from the neighbour, the direction is the opposite one.
        let before = atomicOr(&places[place], 1u << (next + DIRECTIONS - 1u - k));
        if (before & (ALL_DIRECTIONS << next)) == 0u {
            atomicAdd(&counts[CLAIMED + step + 1u], 1u);
            let cell = other.y / CELL * cells_across() + other.x / CELL;
            if atomicMax(&cells[cell].listed, step + 1u) <= step {
                cells[atomicAdd(&counts[LISTED + step + 1u], 1u)].list[(step + 1u) % 2u] = cell;
            }
        }
    }
}
