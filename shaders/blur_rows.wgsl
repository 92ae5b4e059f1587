// Pass blur_rows: the horizontal low-rank filters of a bin, four terms at a time.
// Reads premultiplied colour and coverage; writes one such picture per term.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> bin_info: Bin;
@group(0) @binding(2) var<uniform> group: Group;
@group(0) @binding(3) var<storage, read> bank: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> node_reach: array<u32>;
@group(0) @binding(5) var<storage, read> edges: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> source: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> rows: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read> scene: array<vec4<f32>>;

fn taps_at(pixel: vec2<u32>) -> Taps {
    var radii = vec2(abs(scene[pixel.y * frame.size.x + pixel.x].w));
    if frame.compositing != 2u {
        let rows_of = between_cells(pixel.y, bin_info.cells.y);
        let edge = pixel.x / SEGMENT;
        let above = rows_of.above * bin_info.edges + edge;
        let below = rows_of.below * bin_info.edges + edge;
        radii = mix(vec2(edges[2u * above].x, edges[2u * above + 2u].x),
                    vec2(edges[2u * below].x, edges[2u * below + 2u].x), rows_of.share);
    }
    let left = node_at(radii.x, frame.steps_per_px, frame.nodes);
    let right = node_at(radii.y, frame.steps_per_px, frame.nodes);
    let along = (f32(pixel.x % SEGMENT) + 0.5) / f32(SEGMENT);
    return Taps(node_origin(left, frame.reach, frame.groups, group.index),
                node_origin(right, frame.reach, frame.groups, group.index),
                along, i32(node_reach[max(left, right)]));
}

@compute @workgroup_size(64, 1)
fn blur_rows(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= bin_info.size) {
        return;
    }
    let taps = taps_at(id.xy);
    // A gather's only bin has the picture's scale, and turns where the pixel itself is in front.
    let gathers = frame.compositing == 2u;
    let turned = bin_info.turned == 1u || (gathers && scene[id.y * frame.size.x + id.x].w < 0.0);
    let line = id.y * bin_info.size.x;
    var sum0 = vec4(0.0);
    var sum1 = vec4(0.0);
    var sum2 = vec4(0.0);
    var sum3 = vec4(0.0);
    for (var j = -taps.reach; j <= taps.reach; j++) {
        let offset = select(j, -j, turned) * i32(frame.groups);
        let weight = mix(bank[u32(i32(taps.left) + offset)], bank[u32(i32(taps.right) + offset)], taps.along);
        let x = clamp(i32(id.x) + j, 0, i32(bin_info.size.x) - 1);
        let value = source[line + u32(x)];
        sum0 += weight.x * value;
        sum1 += weight.y * value;
        sum2 += weight.z * value;
        sum3 += weight.w * value;
    }
    let pixels = bin_info.size.x * bin_info.size.y;
    rows[line + id.x] = sum0;
    if group.terms > 1u { rows[pixels + line + id.x] = sum1; }
    if group.terms > 2u { rows[2u * pixels + line + id.x] = sum2; }
    if group.terms > 3u { rows[3u * pixels + line + id.x] = sum3; }
}
