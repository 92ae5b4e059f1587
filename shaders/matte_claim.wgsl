// Shared by the passes that trace: from entries that show something near though the map has none there, to their neighbours that
// may do so, too. Such a pass has `metres`, `places`, `cells` and `counts`.

const ALL_DIRECTIONS = (1u << DIRECTIONS) - 1u;

// What claims a pixel for a step, of the bits in `places`, is moved by so many.
fn shift_of(step: u32) -> u32 {
    return DIRECTIONS * (step % 2u);
}

// Claims the neighbours of a pixel for the next step, where they are as far as its far surface. Those of this step, and those
// that have an entry, are taken.
fn claim(at: u32, far: f32, step: u32) {
    let pixel = vec2(at % frame.size.x, at / frame.size.x);
    let taken = ENTERED | (ALL_DIRECTIONS << shift_of(step));
    let next = shift_of(step + 1u);
    for (var k = 0u; k < DIRECTIONS; k++) {
        // Beyond the first column and row it is larger than any.
        let other = pixel + vec2(k % 3u, k / 3u) - 1u;
        if k == DIRECTIONS / 2u || any(other >= frame.size) {
            continue;
        }
        let place = other.y * frame.size.x + other.x;
        if (atomicLoad(&places[place]) & taken) != 0u || abs(inverse_of(metres[place]) - far) > frame.jump {
            continue;
        }
        // Seen from there, the directions are the other way round.
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
