// Shared by the passes that ask what lies behind a pixel. Such a pass has what is remembered of each as `known`: sRGB, 3 bytes a
// pixel; for how many rounds it was seen, a byte; bits of its inverse depth.

fn rounds_at() -> u32 {
    return (3u * frame.size.x * frame.size.y + 3u) / 4u;
}

fn inverse_at() -> u32 {
    return rounds_at() + (frame.size.x * frame.size.y + 3u) / 4u;
}

// Whether the light behind a pixel is known, whose nearer surface has this inverse depth.
fn is_known_behind(at: u32, near: f32) -> bool {
    if frame.known == 0u {
        return false;
    }
    let rounds = (known[rounds_at() + at / 4u] >> (8u * (at % 4u))) & 255u;
    return rounds >= frame.known && near - bitcast<f32>(known[inverse_at() + at]) > frame.other;
}

// That light, as the camera exposes now.
fn light_behind(at: u32) -> vec3<f32> {
    let word = 3u * at / 4u;
    let codes = codes_of(known[word], known[min(word + 1u, arrayLength(&known) - 1u)], 3u * at);
    return vec3(lights[codes.x].y, lights[codes.y].z, lights[codes.z].w);
}
