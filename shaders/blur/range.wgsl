// Shared by passes that compute the CoC range of every tile of the picture, so that later passes can skip tiles.

const HUGE: f32 = 3.0e38;
const NOTHING = vec2(HUGE, -HUGE);

var<workgroup> seen: array<vec2<f32>, TILE * TILE>;

fn union_ranges(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return vec2(min(a.x, b.x), max(a.y, b.y));
}

// The range over a tile, given the range of each thread. In two steps: atomics on one word would be serialised.
fn reduce_tile_range(thread: u32, threads: u32, own: vec2<f32>) -> vec2<f32> {
    seen[thread] = own;
    workgroupBarrier();
    var range = NOTHING;
    for (var k = thread; thread < TILE && k < threads; k += TILE) {
        range = union_ranges(range, seen[k]);
    }
    workgroupBarrier();
    seen[thread] = range;
    workgroupBarrier();
    range = seen[0];
    for (var k = 1u; k < TILE; k++) {
        range = union_ranges(range, seen[k]);
    }
    return range;
}
