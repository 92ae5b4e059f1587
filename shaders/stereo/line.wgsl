// Included by the passes that process all pixels, or words, in linear order.

const LINE = 64u;

fn linear_index(workgroup: vec3<u32>, workgroups: vec3<u32>, thread: u32) -> u32 {
    return (workgroup.y * workgroups.x + workgroup.x) * LINE + thread;
}
