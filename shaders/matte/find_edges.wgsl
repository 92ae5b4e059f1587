// Pass matte_find_edges: edge detection: pixels beside a depth discontinuity, as bits, and the list of cells that contain
// one.
// twin: src/depth/matting/edges.rs

@group(0) @binding(1) var<storage, read> metres: array<u32>;
@group(0) @binding(2) var<storage, read_write> words: array<vec2<u32>>;     // bits, and how many are set before
@group(0) @binding(3) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> cells: array<Cell>;

// Rows of a workgroup, and its size with a border of one pixel.
const ROWS = 8u;
const WIDE_PX = WORD + 2u;
const TALL_PX = ROWS + 2u;

var<workgroup> inverse: array<f32, WIDE_PX * TALL_PX>;
var<workgroup> bits: array<atomic<u32>, ROWS>;

@compute @workgroup_size(WORD, ROWS)
fn matte_find_edges(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>,
                @builtin(local_invocation_index) thread: u32) {
    let corner = group.xy * vec2(WORD, ROWS);
    for (var k = thread; k < WIDE_PX * TALL_PX; k += WORD * ROWS) {
        let by = vec2(k % WIDE_PX, k / WIDE_PX);
        let pixel = min(max(corner + by, vec2(1u)) - 1u, frame.size - 1u);
        inverse[k] = inverse_depth(metres[pixel.y * frame.size.x + pixel.x]);
    }
    if local.x == 0u {
        atomicStore(&bits[local.y], 0u);
    }
    workgroupBarrier();
    var near = 0.0;
    var far = inverse[local.y * WIDE_PX + local.x];
    for (var k = 0u; k < 9u; k++) {
        let value = inverse[(local.y + k / 3u) * WIDE_PX + local.x + k % 3u];
        near = max(near, value);
        far = min(far, value);
    }
    let pixel = corner + local.xy;
    if all(pixel < frame.size) && near - far > frame.depth_step {
        atomicOr(&bits[local.y], 1u << local.x);
        let own = inverse[(local.y + 1u) * WIDE_PX + local.x + 1u];
        atomicAdd(&counts[STEP_SIZES + size_of_step(near, far, own)], 1u);
    }
    workgroupBarrier();
    if local.x == 0u && pixel.y < frame.size.y {
        words[pixel.y * words_across() + group.x].x = atomicLoad(&bits[local.y]);
    }
    if local.y == 0u && local.x % CELL == 0u {
        var any_row = 0u;
        for (var row = 0u; row < ROWS; row++) {
            any_row |= atomicLoad(&bits[row]) >> local.x;
        }
        if (any_row & ((1u << CELL) - 1u)) != 0u {
            cells[atomicAdd(&counts[LISTED], 1u)].list[0] = pixel.y / CELL * cells_across() + pixel.x / CELL;
        }
    }
}
