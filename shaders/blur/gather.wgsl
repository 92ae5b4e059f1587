// Pass gather: the exact two-dimensional gather, every pixel with the full kernel of its own radius. For comparison.
// twin: src/bokeh/cpu/gather.rs (`ExactGatherRow`)

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> kernel_starts: array<u32>;
@group(0) @binding(2) var<storage, read> kernels: array<f32>;
@group(0) @binding(3) var<storage, read> scene: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read> node_half_width: array<u32>;
@group(0) @binding(5) var<storage, read_write> blurred: array<vec2<u32>>;

@compute @workgroup_size(TILE, TILE)
fn gather(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let pixel = id.y * frame.size.x + id.x;
    let coc_px = unpack_scene(scene[pixel], frame.max_px).w;
    let node = nearest_node(abs(coc_px), frame.steps_per_px, frame.nodes);
    let half_width = i32(node_half_width[node]);
    // In front of the focal plane the aperture is rotated by 180 degrees.
    let sign = select(1, -1, coc_px < 0.0);
    var tap = kernel_starts[node];
    var sum = vec3(0.0);
    for (var j = -half_width; j <= half_width; j++) {
        let y = u32(clamp(i32(id.y) + sign * j, 0, i32(frame.size.y) - 1));
        for (var i = -half_width; i <= half_width; i++) {
            let x = u32(clamp(i32(id.x) + sign * i, 0, i32(frame.size.x) - 1));
            sum += kernels[tap] * unpack_scene(scene[y * frame.size.x + x], frame.max_px).rgb;
            tap++;
        }
    }
    blurred[pixel] = pack_half4(vec4(sum, 1.0));
}
