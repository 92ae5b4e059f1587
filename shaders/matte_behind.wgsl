// Included by passes that read the remembered background. They bind it as `known`: sRGB, 3 bytes a pixel; then for each
// pixel the number of rounds in which it was seen, a byte; then its inverse depth, as the bits of a float.
// twin: src/depth/matting/behind.rs

fn rounds_at() -> u32 {
    return (3u * frame.size.x * frame.size.y + 3u) / 4u;
}

fn inverse_at() -> u32 {
    return rounds_at() + (frame.size.x * frame.size.y + 3u) / 4u;
}

// Whether the background behind a pixel is known, for a nearer surface at inverse depth `near`.
fn is_known_behind(at: u32, near: f32) -> bool {
    if frame.known == 0u {
        return false;
    }
    let rounds = (known[rounds_at() + at / 4u] >> (8u * (at % 4u))) & 255u;
    return rounds >= frame.known && near - bitcast<f32>(known[inverse_at() + at]) > frame.other;
}

// The remembered light behind a pixel, at the camera's current exposure.
fn light_behind(at: u32) -> vec3<f32> {
    let word = 3u * at / 4u;
    let codes = codes_of(known[word], known[min(word + 1u, arrayLength(&known) - 1u)], 3u * at);
    return vec3(lights[codes.x].y, lights[codes.y].z, lights[codes.z].w);
}
