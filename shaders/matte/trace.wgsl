// Pass matte_trace: one step beyond the edges. Creates entries for the claimed pixels, between the surfaces of the
// first pixel that claimed them, and evaluates them; those with some alpha claim their neighbours for the next step.
// Workgroups loop over the listed cells.
// twin: src/depth/matting/trace.rs

@group(0) @binding(1) var<uniform> run: PassRun;      // the step, from 1
@group(0) @binding(2) var<uniform> lights: array<vec4<f32>, 256>;
@group(0) @binding(3) var<storage, read> metres: array<u32>;
@group(0) @binding(4) var<storage, read> rgb: array<u32>;
@group(0) @binding(5) var<storage, read> background: array<u32>;
@group(0) @binding(6) var<storage, read> partials: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read> clusters: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(9) var<storage, read_write> cells: array<Cell>;
@group(0) @binding(10) var<storage, read_write> places: array<atomic<u32>>;
@group(0) @binding(11) var<storage, read_write> entries: array<Entry>;
@group(0) @binding(12) var<storage, read_write> colors: array<Color>;

var<workgroup> listed: u32;
var<workgroup> own_cell: u32;
var<workgroup> first: u32;

// Number of cells listed for this step; 0 if there is no room for its pixels.
fn listed_cell_count() -> u32 {
    var all = atomicLoad(&counts[EDGES]);
    for (var step = 1u; step <= run.index; step++) {
        all += atomicLoad(&counts[CLAIMED + step]);
    }
    return select(atomicLoad(&counts[LISTED + run.index]), 0u, all > frame.max_entries);
}

@compute @workgroup_size(LANES)
fn matte_trace(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) thread: u32) {
    if thread == 0u {
        listed = listed_cell_count();
    }
    let end = workgroupUniformLoad(&listed);
    if group.x >= end {
        return;
    }
    let prior = prior_after(PRIOR_ROUNDS, thread);
    for (var k = group.x; k < end; k += groups.x) {
        if thread == 0u {
            own_cell = cells[k].list[run.index % 2u];
        }
        let number = workgroupUniformLoad(&own_cell);
        let cell = vec2(number % cells_across(), number / cells_across());
        let pixel = cell * CELL + vec2(thread % CELL, thread / CELL);
        let at = pixel.y * frame.size.x + pixel.x;
        var claims = 0u;
        if all(pixel < frame.size) {
            let place = atomicLoad(&places[at]);
            claims = select((place >> claim_shift(run.index)) & ALL_DIRECTIONS, 0u, (place & ENTERED) != 0u);
        }
        let is_chosen = claims != 0u;
        let count = count_chosen(thread, is_chosen);
        if thread == 0u {
            first = atomicAdd(&counts[NEXT], count);
        }
        let entry = workgroupUniformLoad(&first) + rank_among_chosen(thread);
        var surfaces = vec2(0.0);
        if is_chosen {
            let direction = firstTrailingBit(claims);
            let other = pixel + vec2(direction % 3u, direction / 3u) - 1u;
            let parent = atomicLoad(&places[other.y * frame.size.x + other.x]) & ~ENTERED;
            surfaces = vec2(entries[parent].near, entries[parent].far);
        }
        if create_entries(cell, cells[number].latest_model, count, thread, is_chosen, entry, at, surfaces,
                          OUTLINE * BEYOND + STEP * run.index) {
            let alpha = posterior_alpha(entry, prior, 0u);
            entries[entry].alpha = alpha;
            if alpha >= MIN_TRACED_ALPHA {
                atomicOr(&entries[entry].flags, SEEN);
                if run.index < STEPS_TRACED {
                    claim_neighbours(at, surfaces.y, run.index);
                }
            }
        }
        workgroupBarrier();
    }
}
