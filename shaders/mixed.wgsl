// Shared by the passes that take mixed pixels apart. Such a pass has the list of them as `mixed`, by ascending `at`.

struct MixedPixel {
    at: u32,            // pixel: row times columns plus column
    near: u32,          // as uploaded, metres of the nearer and the farther surface; after unpack, the nearer one as a
    far: u32,           // pixel of the scene. The farther one is in the scene.
    share: f32,         // how much of the pixel the nearer surface covers
    behind: f32,        // how much of it is known of the farther surface
    red: f32,           // colour of the nearer surface less that of the farther one
    green: f32,
    blue: f32,
}

// The first mixed pixel that is not before a pixel.
fn first_mixed(pixel: u32) -> u32 {
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
    return (value.y & MIXED) != 0u;
}

// The nearer surface of a mixed pixel.
fn near_surface(index: u32) -> vec4<f32> {
    return scene_unpacked(vec2(mixed[index].near, mixed[index].far), frame.most_px);
}
