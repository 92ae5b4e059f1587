// Included by passes that read colours. They bind `lights`: for each code its linear light, and that of a remembered
// code in each channel; and the picture as `rgb`, 3 bytes a pixel.

// Extracts three bytes from byte offset `byte` on, of the `word` that contains it and the `next` one.
fn unpack_codes(word: u32, next: u32, byte: u32) -> vec3<u32> {
    let first = 8u * (byte % 4u);
    let bits = (word >> first) | select(0u, next << ((32u - first) % 32u), first > 8u);
    return vec3(bits, bits >> 8u, bits >> 16u) & vec3(255u);
}

fn light_at(at: u32) -> vec3<f32> {
    let word = 3u * at / 4u;
    let codes = unpack_codes(rgb[word], rgb[min(word + 1u, arrayLength(&rgb) - 1u)], 3u * at);
    return vec3(lights[codes.x].x, lights[codes.y].x, lights[codes.z].x);
}
