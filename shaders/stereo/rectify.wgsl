// Pass stereo_rectify: each byte is interpolated bilinearly from four others, in fixed point.
// twin: src/calibration/map.rs

override BYTES: u32;        // bytes of the picture
override STRIDE: u32;       // bytes per row
override CHANNELS: u32;     // bytes per pixel
override ONE: u32;          // one in fixed point
override DOWN_SHIFT: u32;   // where the second fraction begins
override NOWHERE: u32;      // the fractions of a pixel outside the source

@group(0) @binding(0) var<storage, read> starts: array<u32>;
@group(0) @binding(1) var<storage, read> fractions: array<u32>;
@group(0) @binding(2) var<storage, read> raw: array<u32>;
@group(0) @binding(3) var<storage, read_write> rectified: array<u32>;

fn raw_at(byte: u32) -> u32 {
    return (raw[byte / 4u] >> (8u * (byte % 4u))) & 255u;
}

fn rectified_at(byte: u32) -> u32 {
    let pixel = byte / CHANNELS;
    let parts = fractions[pixel];
    if parts == NOWHERE {
        return 0u;
    }
    let across = parts & (2u * ONE - 1u);
    let down = (parts >> DOWN_SHIFT) & (2u * ONE - 1u);
    let both = (across * down + ONE / 2u) / ONE;
    let upper = starts[pixel] * CHANNELS + byte % CHANNELS;
    let lower = upper + STRIDE;
    let sum = raw_at(upper) * (ONE + both - across - down) + raw_at(upper + CHANNELS) * (across - both)
        + raw_at(lower) * (down - both) + raw_at(lower + CHANNELS) * both;
    return (sum + ONE / 2u) / ONE;
}

@compute @workgroup_size(LINE)
fn stereo_rectify(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
                  @builtin(local_invocation_index) thread: u32) {
    let word = linear_index(workgroup, workgroups, thread);
    if 4u * word >= BYTES {
        return;
    }
    var packed = 0u;
    for (var k = 0u; k < min(4u, BYTES - 4u * word); k++) {
        packed |= rectified_at(4u * word + k) << (8u * k);
    }
    rectified[word] = packed;
}
