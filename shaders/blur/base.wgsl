// Shared by passes that need level 0 of the pyramid: colour and CoC, known only if neither the pixel nor a neighbour is
// occluded by something in front of the layer. Such a pass binds `work`, `frame`, `scene`, `mixed` and `nearest_px`.
// twin: src/bokeh/cpu/levels.rs (`Base`)

fn base_pixel(pixel: vec2<u32>) -> Known {
    let size = finest_size();
    let first = pixel - min(pixel, vec2(1u));
    let last = min(pixel + 1u, size - 1u);
    var nearest = 0.0;
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            nearest = min(nearest, nearest_px[y * size.x + x]);
        }
    }
    let known_weight = linear_step(work.visible_weight, nearest);
    var sum = vec4(0.0);
    for (var sub = 0u; sub < 4u; sub++) {
        let at = min(2u * pixel + vec2(sub % 2u, sub / 2u), frame.size - 1u);
        let index = at.y * frame.size.x + at.x;
        var seen = unpack_scene(scene[index], frame.max_px);
        // A mixed pixel counts as the composite it shows: its farther surface is not in front of the subject.
        if is_mixed(scene[index]) {
            let k = find_mixed_index(index);
            let near = load_near_surface(k);
            seen = vec4(mix(seen.rgb, near.rgb, mixed[k].alpha), select(seen.w, near.w, mixed[k].alpha > 0.5));
        }
        sum += 0.25 * seen;
    }
    return Known(sum * known_weight, known_weight);
}
