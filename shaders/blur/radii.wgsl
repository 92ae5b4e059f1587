// Shared by passes that compute the CoC of any pixel. Such a pass binds `frame`, and the depth map as `metres`.
// twin: src/optics.rs

fn coc_at(x: u32, y: u32) -> f32 {
    if frame.coc_kind == 0u {
        return frame.coc.x;
    }
    if frame.coc_kind == 1u {
        let distance_px = abs(frame.coc.x * f32(x) + frame.coc.y * f32(y) - frame.coc.z) - frame.coc.w;
        return min(max(distance_px, 0.0) * frame.ramp.x, frame.ramp.y);
    }
    if all(frame.depth_size == frame.size) {
        return depth_to_coc(metres[y * frame.size.x + x]);
    }
    let column = min((2u * x + 1u) * frame.depth_size.x / (2u * frame.size.x), frame.depth_size.x - 1u);
    let row = min((2u * y + 1u) * frame.depth_size.y / (2u * frame.size.y), frame.depth_size.y - 1u);
    return depth_to_coc(metres[row * frame.depth_size.x + column]);
}

fn depth_to_coc(distance_m: f32) -> f32 {
    // Unknown depth counts as infinite. The largest finite number stands in for infinity.
    var inverse_m = 0.0;
    if distance_m > 0.0 && distance_m < 3.0e38 {
        inverse_m = 1.0 / distance_m;
    }
    // 1 within the sharp range; outside, the end of the range whose ratio is nearer to 1.
    let ratio = max(frame.coc.y * inverse_m, min(frame.coc.z * inverse_m, 1.0));
    return clamp(frame.coc.x * (1.0 - ratio), -frame.coc.w, frame.coc.w);
}
