// YUYV of BT.601 in limited range, bit-exact to crates/live/src/sink/yuyv.rs.

// Channels of packed sRGB: red in the lowest byte, then green and blue.
fn unpack_rgb(codes: u32) -> vec3<i32> {
    return vec3<i32>(vec3(codes, codes >> 8u, codes >> 16u) & vec3(255u));
}

// Weighted sum of channels in limited range.
fn weigh_channels(weights: vec3<i32>, rgb: vec3<i32>, zero: i32) -> u32 {
    let product = weights * rgb;
    return u32(((product.x + product.y + product.z + 128) >> 8u) + zero);
}

// Packs two pixels, which share their chroma.
fn pack_yuyv(left: u32, right: u32) -> u32 {
    let a = unpack_rgb(left);
    let b = unpack_rgb(right);
    let luma = vec3(66, 129, 25);
    return weigh_channels(luma, a, 16) | (weigh_channels(vec3(-19, -37, 56), a + b, 128) << 8u)
        | (weigh_channels(luma, b, 16) << 16u) | (weigh_channels(vec3(56, -47, -9), a + b, 128) << 24u);
}
