// Shared by passes that find silhouettes. Distances of a silhouette in pixels: up to where anything farther is visible
// past it; the same if the farther surface is not in front of the subject; up to where the hidden background matters.
// -1 if nowhere.
// twin: src/bokeh/occlusion.rs, src/bokeh/cpu/marking.rs

const NO_SILHOUETTE = vec4(-1.0);

// The mark of two adjacent surfaces.
fn silhouette_between(a_px: f32, b_px: f32, min_step_px: f32) -> vec4<f32> {
    let near_px = min(a_px, b_px);
    let far_px = max(a_px, b_px);
    if far_px - near_px < max(min_step_px, OTHER_SURFACE_FROM * abs(near_px)) {
        return NO_SILHOUETTE;
    }
    let visible_px = abs(near_px) + MARGIN_PX;
    return vec4(visible_px, select(-1.0, visible_px, far_px > frame.front_px), visible_px + abs(far_px), -1.0);
}

// The mark of a pixel: its discontinuities to the right and below.
fn mark_pixel(x: u32, y: u32, min_step_px: f32) -> vec4<f32> {
    let own = coc_at(x, y);
    let right = coc_at(min(x + 1u, frame.size.x - 1u), y);
    let below = coc_at(x, min(y + 1u, frame.size.y - 1u));
    return max(silhouette_between(own, right, min_step_px), silhouette_between(own, below, min_step_px));
}
