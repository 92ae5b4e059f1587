// Pass stereo_pack: packs two pixels per word, the layout of the CPU's map.

@group(0) @binding(0) var<storage, read> filled: array<u32>;
@group(0) @binding(1) var<storage, read_write> words: array<u32>;

@compute @workgroup_size(LINE)
fn stereo_pack(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
               @builtin(local_invocation_index) thread: u32) {
    let word = linear_index(workgroup, workgroups, thread);
    let pixel = 2u * word;
    if pixel >= WIDTH * HEIGHT {
        return;
    }
    let other = min(pixel + 1u, WIDTH * HEIGHT - 1u);
    words[word] = filled[pixel] | (filled[other] << 16u);
}
