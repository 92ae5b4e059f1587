// Shared by the passes that find silhouettes. What is noted of one: how far, in pixels, anything farther can be seen past it; the
// same of what does not lie in front of the subject; how far what it hides can matter. -1 where not at all; occlusion.rs has more.

const NO_SILHOUETTE = vec4(-1.0);

// The mark of two surfaces side by side.
fn silhouette(a_px: f32, b_px: f32, least_px: f32) -> vec4<f32> {
    let near_px = min(a_px, b_px);
    let far_px = max(a_px, b_px);
    if far_px - near_px < max(least_px, OTHER_FROM * abs(near_px)) {
        return NO_SILHOUETTE;
    }
    let shows_px = abs(near_px) + MARGIN_PX;
    return vec4(shows_px, select(-1.0, shows_px, far_px > frame.front_px), shows_px + abs(far_px), -1.0);
}

// The mark of a pixel, by those beside and below it.
fn mark_at(x: u32, y: u32, least_px: f32) -> vec4<f32> {
    let own = coc_of(x, y);
    let right = coc_of(min(x + 1u, frame.size.x - 1u), y);
    let below = coc_of(x, min(y + 1u, frame.size.y - 1u));
    return max(silhouette(own, right, least_px), silhouette(own, below, least_px));
}
