// Included by the pass that evaluates windows: the votes of one column. It binds `votes` and `spatial_weights`.
// twin: src/depth/refine/votes.rs

const ROWS = 9u;
const RADIUS_PX = 12;
const STEP_PX = 2;
const ROW_STEP_PX = 3;

struct Column {
    depth: array<f32, ROWS>,    // inverse depths of the votes
    weight: array<f32, ROWS>,
    total: vec2<f32>,           // sums of the weights, without colour and with it
    range: vec2<f32>,           // smallest and largest inverse depth that has a vote
}

fn unpack_confidence(word: u32) -> f32 {
    return select(select(1.0, UNCERTAIN, (word >> 24u) == 1u), FILLED, (word >> 24u) == 2u);
}

// Computes column number `lane` of the window around a pixel of this colour.
fn compute_column(pixel: vec2<u32>, color: vec3<f32>, lane: u32) -> Column {
    var own: Column;
    own.total = vec2(0.0);
    own.range = vec2(3.0e38, 0.0);
    let x = i32(pixel.x) - RADIUS_PX + i32(lane) * STEP_PX;
    for (var row = 0u; row < ROWS; row++) {
        let y = i32(pixel.y) - RADIUS_PX + i32(row) * ROW_STEP_PX;
        own.weight[row] = 0.0;
        own.depth[row] = 0.0;
        if x < 0 || x >= i32(frame.size.x) || y < 0 || y >= i32(frame.size.y) {
            continue;
        }
        let vote = votes[u32(y) * frame.size.x + u32(x)];
        let off = unpack_color(vote.y) - color;
        var similarity = max(1.0 - dot(off, off) * QUARTER_T, 0.0);
        similarity *= similarity;
        let without_color = unpack_confidence(vote.y) * spatial_weights[row * LANES + lane];
        let weight = without_color * (similarity * similarity + MIN_SIMILARITY);
        let v = bitcast<f32>(vote.x);
        own.total += vec2(without_color, weight);
        own.weight[row] = weight;
        own.depth[row] = v;
        own.range = select(own.range, vec2(min(own.range.x, v), max(own.range.y, v)), weight > 0.0);
    }
    return own;
}
