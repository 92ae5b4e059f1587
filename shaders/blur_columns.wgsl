// Pass blur_columns: the vertical low-rank filters, terms summed; truncation leaves lobes, so the result is kept in
// the range of the colours in reach.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> bin_info: Bin;
@group(0) @binding(2) var<uniform> group: Group;
@group(0) @binding(3) var<storage, read> bank: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> node_reach: array<u32>;
@group(0) @binding(5) var<storage, read> edges: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> rows: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> blurred: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read> scene: array<vec4<f32>>;

@compute @workgroup_size(64, 1)
fn blur_columns(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= bin_info.size) {
        return;
    }
    let pixel = id.y * bin_info.size.x + id.x;
    let gathers = frame.compositing == 2u;
    let rows_of = between_cells(id.y, bin_info.cells.y);
    let above = 2u * (rows_of.above * bin_info.edges + id.x / SEGMENT);
    let below = 2u * (rows_of.below * bin_info.edges + id.x / SEGMENT);
    let left_edge = mix(edges[above], edges[below], rows_of.share);
    let right_edge = mix(edges[above + 2u], edges[below + 2u], rows_of.share);
    // A gather's only bin has the picture's scale.
    let coc_px = scene[min(pixel, frame.size.x * frame.size.y - 1u)].w;
    let radii = select(vec2(left_edge.x, right_edge.x), vec2(abs(coc_px)), gathers);
    let left = node_at(radii.x, frame.steps_per_px, frame.nodes);
    let right = node_at(radii.y, frame.steps_per_px, frame.nodes);
    let left_tap = i32(node_origin(left, frame.reach, frame.groups, group.index));
    let right_tap = i32(node_origin(right, frame.reach, frame.groups, group.index));
    let along = (f32(id.x % SEGMENT) + 0.5) / f32(SEGMENT);
    let reach = i32(node_reach[max(left, right)]);
    let turned = bin_info.turned == 1u || (gathers && coc_px < 0.0);
    let pixels = bin_info.size.x * bin_info.size.y;

    var sum = vec4(0.0);
    for (var j = -reach; j <= reach; j++) {
        let offset = select(j, -j, turned) * i32(frame.groups);
        let weight = mix(bank[u32(left_tap + offset)], bank[u32(right_tap + offset)], along);
        let y = clamp(i32(id.y) + j, 0, i32(bin_info.size.y) - 1);
        let at = u32(y) * bin_info.size.x + id.x;
        sum += weight.x * rows[at];
        if group.terms > 1u { sum += weight.y * rows[pixels + at]; }
        if group.terms > 2u { sum += weight.z * rows[2u * pixels + at]; }
        if group.terms > 3u { sum += weight.w * rows[3u * pixels + at]; }
    }
    if group.index > 0u {
        sum += blurred[bin_info.offset + pixel];
    }
    if group.last == 1u && !gathers {
        let low = mix(left_edge.yzw, right_edge.yzw, along);
        let high = mix(mix(edges[above + 1u], edges[below + 1u], rows_of.share),
                       mix(edges[above + 3u], edges[below + 3u], rows_of.share), along).xyz;
        sum.a = clamp(sum.a, 0.0, 1.0);
        sum = vec4(min(max(sum.rgb, low * sum.a), high * sum.a), sum.a);
    }
    blurred[bin_info.offset + pixel] = sum;
}
