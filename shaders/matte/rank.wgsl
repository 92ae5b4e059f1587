// Included by passes that rank edge pixels by their size of step: half octaves, from the smallest one on.
// twin: src/depth/matting/rank.rs

// Index of the size of step of a pixel, from the largest and the smallest inverse depth around, and its own. If it is
// the farther one, its own surface is the far one.
fn size_of_step(near: f32, far: f32, own: f32) -> u32 {
    let step = near - select(far, own, near - own > frame.depth_step);
    let half_octaves = (bitcast<u32>(step) >> BITS_BELOW_SIZE) - (bitcast<u32>(frame.depth_step) >> BITS_BELOW_SIZE);
    return min(half_octaves, SIZES - 1u);
}
