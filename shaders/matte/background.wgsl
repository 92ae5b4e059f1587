// Included by passes that read the remembered background. They bind it as `background`: sRGB, 3 bytes a pixel; then for each
// pixel the number of rounds in which it was seen, a byte; then its inverse depth, as the bits of a float.
// twin: src/depth/matting/known_background.rs

fn rounds_offset() -> u32 {
    return (3u * frame.size.x * frame.size.y + 3u) / 4u;
}

fn inverse_offset() -> u32 {
    return rounds_offset() + (frame.size.x * frame.size.y + 3u) / 4u;
}

// Whether the background behind a pixel is known, for a nearer surface at inverse depth `near`.
fn is_background_known(at: u32, near: f32) -> bool {
    if frame.min_rounds == 0u {
        return false;
    }
    let rounds = (background[rounds_offset() + at / 4u] >> (8u * (at % 4u))) & 255u;
    return rounds >= frame.min_rounds && near - bitcast<f32>(background[inverse_offset() + at]) > frame.surface_step;
}

// The remembered light behind a pixel, at the camera's current exposure.
fn background_light(at: u32) -> vec3<f32> {
    let word = 3u * at / 4u;
    let codes = unpack_codes(background[word], background[min(word + 1u, arrayLength(&background) - 1u)], 3u * at);
    return vec3(lights[codes.x].y, lights[codes.y].z, lights[codes.z].w);
}
