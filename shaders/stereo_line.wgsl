// Shared by the passes that go through all pixels, or words, in one line.

const LINE = 64u;

fn line_at(workgroup: vec3<u32>, workgroups: vec3<u32>, thread: u32) -> u32 {
    return (workgroup.y * workgroups.x + workgroup.x) * LINE + thread;
}
