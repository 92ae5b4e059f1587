// Pass stereo_cost: the matching cost, an eighth of the Hamming distance of the census codes summed over 3x3 pixels,
// less a bonus for likely disparities. A workgroup processes a strip of a row.
// twin: src/depth/stereo/cpu/cost.rs

@group(0) @binding(0) var<storage, read> census: array<u32>;        // left, then right
@group(0) @binding(1) var<storage, read> likely: array<u32>;        // one more than the likely disparity, or 0
@group(0) @binding(2) var<storage, read_write> costs: array<u32>;   // four per word, `[row][column][word]`

const STRIP = 16u;

// Returns the Hamming distances at four disparities of a column, summed over three rows. The outermost columns and rows
// repeat.
fn column_distances(x: i32, y: u32, word: u32) -> vec4<u32> {
    let column = u32(clamp(x, 0, i32(WIDTH) - 1));
    let disparities = 4u * word + vec4(0u, 1u, 2u, 3u);
    let outside = disparities > vec4(column);
    let partners = max(vec4(column), disparities) - disparities;
    var sum = vec4(0u);
    for (var k = 0u; k < 3u; k++) {
        let row = (clamp(y + k, 1u, HEIGHT) - 1u) * WIDTH;
        let right = row + WIDTH * HEIGHT + partners;
        let codes = vec4(census[right.x], census[right.y], census[right.z], census[right.w]);
        sum += select(countOneBits(vec4(census[row + column]) ^ codes), vec4(OUTSIDE_COST), outside);
    }
    return sum;
}

// Lowers the costs at a pixel for the likely disparity and those one above and below it.
fn apply_prior(pixel: u32, word: u32, cost: vec4<u32>) -> vec4<u32> {
    let one_more = vec4(likely[pixel]);
    let here = 4u * word + vec4(1u, 2u, 3u, 4u);
    let near = (max(here, one_more) - min(here, one_more) <= vec4(1u)) & (one_more > vec4(0u));
    return cost - select(vec4(0u), min(cost, vec4(PRIOR_BONUS)), near);
}

@compute @workgroup_size(WORDS)
fn stereo_cost(@builtin(workgroup_id) strip: vec3<u32>, @builtin(local_invocation_index) word: u32) {
    let y = strip.y;
    let first = strip.x * STRIP;
    var before = column_distances(i32(first) - 1, y, word);
    var here = column_distances(i32(first), y, word);
    for (var x = first; x < min(first + STRIP, WIDTH); x++) {
        let after = column_distances(i32(x) + 1, y, word);
        let pixel = y * WIDTH + x;
        let cost = (before + here + after + 4u) >> vec4(3u);
        costs[pixel * WORDS + word] = pack4xU8(apply_prior(pixel, word, cost));
        before = here;
        here = after;
    }
}
