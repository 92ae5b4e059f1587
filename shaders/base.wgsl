// Shared by the passes that need level 0 of the pyramid: colour and CoC as far as neither the pixel nor a neighbour is hidden
// by what lies in front of the layer. Such a pass has `work`, `frame`, `scene` and `nearest_px`.

fn base(pixel: vec2<u32>) -> Known {
    let size = finest();
    let first = pixel - min(pixel, vec2(1u));
    let last = min(pixel + 1u, size - 1u);
    var nearest = 0.0;
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            nearest = min(nearest, nearest_px[y * size.x + x]);
        }
    }
    let knows = step_at(work.unhidden, nearest);
    var sum = vec4(0.0);
    for (var sub = 0u; sub < 4u; sub++) {
        let at = min(2u * pixel + vec2(sub % 2u, sub / 2u), frame.size - 1u);
        sum += 0.25 * scene_unpacked(scene[at.y * frame.size.x + at.x], frame.most_px);
    }
    return Known(sum * knows, knows);
}
