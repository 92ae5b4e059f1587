// Shared by the passes whose threads have a part of a line each, and look for the nearest known depths in it. Such a pass has
// `metres`.

// The first and the last known depth of so many pixels, `step` apart; 0 where there is none.
fn known_ends(start: u32, count: u32, step: u32) -> vec2<f32> {
    var ends = vec2(0.0);
    for (var n = 0u; n < count; n++) {
        let depth_m = metres[start + n * step];
        ends.x = select(ends.x, depth_m, ends.x == 0.0);
        ends.y = select(ends.y, depth_m, depth_m > 0.0);
    }
    return ends;
}
