// Pass refine_band: finds depth edges, and the band around them in which depths may be wrong; packs the votes. Begins
// the worklist: pixels at edges in the first round, then those that moved in the last round.
// twin: src/depth/refine/align.rs, src/depth/refine/band.rs

@group(0) @binding(1) var<storage, read> measures: array<f32>;
@group(0) @binding(2) var<storage, read> inverse: array<f32>;
@group(0) @binding(3) var<storage, read> colors: array<u32>;
@group(0) @binding(4) var<storage, read_write> flags: array<u32>;
@group(0) @binding(5) var<storage, read_write> votes: array<vec2<u32>>; // bits of inverse depth; colour and confidence
@group(0) @binding(6) var<storage, read_write> worklist: array<u32>;
@group(0) @binding(7) var<storage, read_write> counts: array<atomic<u32>>;

const TILE = 16u;
const SIDE_PX = 3u;             // width of the band beside an edge pixel
const EDGES = TILE + 2u * SIDE_PX;
const DEPTHS = EDGES + 2u;

var<workgroup> depths: array<f32, DEPTHS * DEPTHS>;
var<workgroup> edges: array<u32, EDGES * EDGES>;
var<workgroup> along: array<u32, EDGES * TILE>;

@compute @workgroup_size(TILE, TILE)
fn refine_band(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>,
               @builtin(local_invocation_index) thread: u32, @builtin(global_invocation_id) id: vec3<u32>) {
    let corner = vec2<i32>(group.xy * TILE);
    let size = vec2<i32>(frame.size);
    for (var n = thread; n < DEPTHS * DEPTHS; n += TILE * TILE) {
        let offset = vec2<i32>(vec2(n % DEPTHS, n / DEPTHS)) - i32(SIDE_PX + 1u);
        let at = vec2<u32>(clamp(corner + offset, vec2(0), size - 1));
        depths[n] = inverse[at.y * frame.size.x + at.x];
    }
    workgroupBarrier();
    let depth_step = measures[STEP];
    for (var n = thread; n < EDGES * EDGES; n += TILE * TILE) {
        let offset = vec2(n % EDGES, n / EDGES);
        let at = corner + vec2<i32>(offset) - i32(SIDE_PX);
        let place = (offset.y + 1u) * DEPTHS + offset.x + 1u;
        let here = depths[place];
        let around = vec4(depths[place - 1u], depths[place + 1u], depths[place - DEPTHS], depths[place + DEPTHS]);
        let is_edge = any(abs(vec4(here) - around) > vec4(EDGE_FRACTION * depth_step_at(depth_step, here)));
        edges[n] = select(0u, 1u, is_edge && all(at >= vec2(0)) && all(at < size));
    }
    workgroupBarrier();
    for (var n = thread; n < EDGES * TILE; n += TILE * TILE) {
        var any_edge = 0u;
        for (var px = 0u; px <= 2u * SIDE_PX; px++) {
            any_edge |= edges[n / TILE * EDGES + n % TILE + px];
        }
        along[n] = any_edge;
    }
    workgroupBarrier();
    if any(id.xy >= frame.size) {
        return;
    }
    var in_band = 0u;
    for (var px = 0u; px <= 2u * SIDE_PX; px++) {
        in_band |= along[(local.y + px) * TILE + local.x];
    }
    let k = id.y * frame.size.x + id.x;
    let before = flags[k];
    let is_edge = edges[(local.y + SIDE_PX) * EDGES + local.x + SIDE_PX] == 1u;
    let is_listed = select(is_edge, in_band == 1u && (before & MOVED_NOW) != 0u, DOWN == 1u);
    // A pixel leaves the band when it joins the worklist, so that it is processed once.
    var now = (before & (UNKNOWN | PROCESSED)) | select(0u, BAND, in_band == 1u && !is_listed);
    now |= select(0u, PROCESSED, is_listed && DOWN == 0u);
    flags[k] = now;
    let confidence = select(in_band, 2u, (before & UNKNOWN) != 0u);
    votes[k] = vec2(bitcast<u32>(depths[(local.y + SIDE_PX + 1u) * DEPTHS + local.x + SIDE_PX + 1u]),
                    colors[k] | (confidence << 24u));
    if is_listed {
        worklist[atomicAdd(&counts[1u + DOWN * (WAVES + 2u)], 1u)] = k;
    }
}
