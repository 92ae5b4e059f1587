// Shared by passes that separate mixed pixels. Such a pass binds their list as `mixed`, by ascending `at`.
// twin: src/frame/matte.rs (`MixedPixel`)

struct MixedPixel {
    at: u32,            // pixel index: row times columns plus column
    near: u32,          // uploaded: metres of the nearer and the farther surface; after unpack: the nearer
    far: u32,           // surface as a scene pixel (the farther one is in the scene)
    alpha: f32,         // alpha of the nearer surface
    background_alpha: f32, // known fraction of the farther surface
    red: f32,           // colour of the nearer surface minus that of the farther one
    green: f32,
    blue: f32,
}

// Index of the first mixed pixel at or after a pixel (binary search).
fn find_mixed_index(pixel: u32) -> u32 {
    var first = 0u;
    var end = frame.mixed;
    while first < end {
        let middle = (first + end) / 2u;
        if mixed[middle].at < pixel {
            first = middle + 1u;
        } else {
            end = middle;
        }
    }
    return first;
}

fn is_mixed(value: vec2<u32>) -> bool {
    return (value.y & MIXED_FLAG) != 0u;
}

// The nearer surface of a mixed pixel.
fn load_near_surface(index: u32) -> vec4<f32> {
    return unpack_scene(vec2(mixed[index].near, mixed[index].far), frame.max_px);
}
