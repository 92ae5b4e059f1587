// Included by the passes whose threads process segments of a line and search the nearest known depths. They bind
// `metres`.

// Returns the first and the last known depth of `count` pixels, `step` apart; 0 without any.
fn find_known_ends(start: u32, count: u32, step: u32) -> vec2<f32> {
    var ends = vec2(0.0);
    for (var n = 0u; n < count; n++) {
        let depth_m = metres[start + n * step];
        ends.x = select(ends.x, depth_m, ends.x == 0.0);
        ends.y = select(ends.y, depth_m, depth_m > 0.0);
    }
    return ends;
}
