// Pass matte_clusters: colour clusters of each cell: mean and covariance of its near and its far surface, and of the
// near surface's edge pixels (fringe). Weighted sums in one workgroup per cell.
// twin: src/depth/matting/clusters/cell.rs

@group(0) @binding(1) var<uniform> lights: array<vec4<f32>, 256>;
@group(0) @binding(2) var<storage, read> metres: array<u32>;
@group(0) @binding(3) var<storage, read> rgb: array<u32>;
@group(0) @binding(4) var<storage, read> words: array<vec2<u32>>;
// Twelve vectors a cell, four a cluster: weight and sums of r, g, b; of rr, rg, rb, gg; of gb, bb, and the mean column
// and row; the mean inverse depth. The sums are weighted.
@group(0) @binding(5) var<storage, read_write> clusters: array<vec4<f32>>;

const PIXELS = CELL * CELL;
// The map may be wrong this close to an edge.
const CLOSE_PX = 3u;
const ROWS = CELL + 2u * CLOSE_PX;
const INFINITE = 0x7f800000u;

// For each pixel: 1, red, green, blue, column, row, inverse depth; and its weight in each of the three clusters.
var<workgroup> values: array<array<f32, 7>, PIXELS>;
var<workgroup> weights: array<array<f32, 3>, PIXELS>;
var<workgroup> edges: array<u32, ROWS>;
// Bits of the largest and the smallest inverse depth, of the pure pixels and of all.
var<workgroup> largest: array<atomic<u32>, 2>;
var<workgroup> least: array<atomic<u32>, 2>;
var<workgroup> sums: array<f32, 39>;

// Edge bits of a row of a cell, with `CLOSE_PX` columns on both sides.
fn edge_bits(left: u32, y: u32) -> u32 {
    let k = y * words_across() + left / WORD;
    let shift = left % WORD;
    let word = words[k].x;
    var before = 0u;
    if shift > 0u {
        before = word >> (shift - CLOSE_PX);
    } else if left > 0u {
        before = words[k - 1u].x >> (WORD - CLOSE_PX);
    }
    var after = 0u;
    if left / WORD + 1u < words_across() && shift > 0u {
        after = words[k + 1u].x << (WORD - shift);
    }
    let all = (((word >> shift) | after) << CLOSE_PX) | (before & ((1u << CLOSE_PX) - 1u));
    return all & ((1u << ROWS) - 1u);
}

@compute @workgroup_size(CELL, CELL)
fn matte_clusters(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>,
                  @builtin(local_invocation_index) thread: u32) {
    let corner = group.xy * CELL;
    let pixel = corner + local.xy;
    let is_there = all(pixel < frame.size);
    let inside = min(pixel, frame.size - 1u);
    let at = inside.y * frame.size.x + inside.x;
    let bits = metres[at];
    let inverse = inverse_depth(bits);
    let light = light_at(at);
    if thread < 2u {
        atomicStore(&largest[thread], 0u);
        atomicStore(&least[thread], INFINITE);
    }
    if thread < ROWS {
        let y = corner.y + thread;
        edges[thread] = 0u;
        if y >= CLOSE_PX && y < frame.size.y + CLOSE_PX {
            edges[thread] = edge_bits(corner.x, y - CLOSE_PX);
        }
    }
    workgroupBarrier();
    var around = 0u;
    for (var by = 0u; by <= 2u * CLOSE_PX; by++) {
        around |= edges[local.y + by];
    }
    let is_close = ((around >> local.x) & ((1u << (2u * CLOSE_PX + 1u)) - 1u)) != 0u;
    let is_edge = ((edges[local.y + CLOSE_PX] >> (local.x + CLOSE_PX)) & 1u) != 0u;
    let value = bitcast<u32>(inverse);
    if is_there {
        atomicMax(&largest[1], value);
        atomicMin(&least[1], value);
    }
    if is_there && !is_edge {
        atomicMax(&largest[0], value);
        atomicMin(&least[0], value);
    }
    workgroupBarrier();
    // One surface if its range is small, or else split at the middle, by pure pixels if there are any.
    let pure_ends = vec2(atomicLoad(&least[0]), atomicLoad(&largest[0]));
    let all_ends = vec2(atomicLoad(&least[1]), atomicLoad(&largest[1]));
    let ends = bitcast<vec2<f32>>(select(all_ends, pure_ends, pure_ends.x <= pure_ends.y));
    let is_one = ends.y - ends.x <= frame.depth_step;
    let is_far = !is_one && inverse <= 0.5 * (ends.x + ends.y);
    let off = abs(inverse - select(ends.y, ends.x, is_far));
    // Every other pixel, as on a chessboard, suffices.
    let counts = is_there && (local.x + local.y) % 2u == 0u && off <= select(1.0, 2.0, is_one) * frame.depth_step;
    let weight = select(0.0, select(select(1.0, CLOSE_WEIGHT, is_close), AT_EDGE_WEIGHT, is_edge), counts);
    let wide = bitcast<vec2<f32>>(all_ends);
    let is_fringe = is_there && is_edge && wide.y - wide.x > frame.depth_step && inverse > 0.5 * (wide.x + wide.y);
    values[thread] = array<f32, 7>(1.0, light.x, light.y, light.z, f32(local.x), f32(local.y), inverse);
    weights[thread] = array<f32, 3>(select(weight, 0.0, is_far), select(0.0, weight, is_far), select(0.0, 1.0, is_fringe));
    workgroupBarrier();
    if thread < 39u {
        // Each sum is over the product of two of the values.
        var first = array<u32, 13>(0u, 0u, 0u, 0u, 1u, 1u, 1u, 2u, 2u, 3u, 0u, 0u, 0u);
        var second = array<u32, 13>(0u, 1u, 2u, 3u, 1u, 2u, 3u, 2u, 3u, 3u, 4u, 5u, 6u);
        let one = first[thread % 13u];
        let other = second[thread % 13u];
        var sum = 0.0;
        for (var k = 0u; k < PIXELS; k++) {
            sum += weights[k][thread / 13u] * values[k][one] * values[k][other];
        }
        sums[thread] = sum;
    }
    workgroupBarrier();
    if thread < 3u {
        let first = 13u * thread;
        let weight = sums[first];
        let scale = select(0.0, 1.0 / max(weight, TINY), weight > 0.0);
        let place = vec2<f32>(corner) + scale * vec2(sums[first + 10u], sums[first + 11u]);
        let out = 12u * (group.y * cells_across() + group.x) + 4u * thread;
        clusters[out] = vec4(weight, sums[first + 1u], sums[first + 2u], sums[first + 3u]);
        clusters[out + 1u] = vec4(sums[first + 4u], sums[first + 5u], sums[first + 6u], sums[first + 7u]);
        clusters[out + 2u] = vec4(sums[first + 8u], sums[first + 9u], place);
        clusters[out + 3u] = vec4(scale * sums[first + 12u], 0.0, 0.0, 0.0);
    }
}
